/* Contact points that ranks bring together (shared_contacts.h). */
#include "contact/shared_contacts.h"

#include <stddef.h>
#include <string.h>

#include "core/memory.h"
#include "mpm/ranks.h"

/* What is sent of a node, to rank 0 and back. */
struct node {
    int64_t id;
    int behind; /* whether it is the node of the layer behind thin bodies */
    struct gr_contact_node node;
    struct gr_contact_origin origin;
};

/* The result of a contact point. */
struct result {
    double impulse[3], pressing;
};

/* What is sent to a rank and received from it. */
struct letter {
    char *out, *in;
    int64_t out_bytes, in_bytes, out_capacity, in_capacity;
    int64_t n, n_nodes; /* contact points and nodes from there; on other ranks, nodes from rank 0 */
    /* on rank 0: the contact point read next, and the nodes with their numbers in the list of all, -1 for none */
    const char *next, *node;
    int64_t read, cell;
    int32_t *number;
    int64_t number_capacity;
};

/* Counts of a rank: its contact points, its nodes, and the bytes of both. */
enum { GR_CONTACTS, GR_CONTACT_NODES, GR_CONTACT_BYTES, GR_CONTACT_COUNTS };

struct gr_shared_contacts {
    struct gr_contact_points all; /* on rank 0 */
    struct gr_table number_of;    /* on rank 0: number of a node in them + 1, by its index in both layers of the grid */
    int32_t *from;                /* of each contact point of all: its rank */
    int64_t *number;              /* counts, and the states of bodies as integers, to be added up over all ranks */
    int size;                     /* number of ranks */
    struct letter *letter;        /* of each rank; other ranks use that of rank 0 */
    struct gr_message *message;
};

static int is_shared(const struct gr_engine *e) { return e->ranks && e->ranks->transport.size > 1; }

struct gr_contact_points *gr_all_contacts(const struct gr_engine *e)
{
    if (!is_shared(e)) return e->bodies.contacts;
    return e->ranks->transport.rank == 0 ? &e->ranks->contacts->all : NULL;
}

/* ---- Memory ---- */

void gr_shared_contacts_free(struct gr_shared_contacts *shared)
{
    if (!shared) return;
    for (int k = 0; shared->letter && k < shared->size; k++) {
        gr_free(shared->letter[k].out);
        gr_free(shared->letter[k].in);
        gr_free(shared->letter[k].number);
    }
    gr_free(shared->all.contact);
    gr_free(shared->all.node);
    gr_free(shared->all.origin);
    gr_table_free(&shared->number_of);
    gr_free(shared->from);
    gr_free(shared->number);
    gr_free(shared->letter);
    gr_free(shared->message);
    gr_free(shared);
}

static int64_t nodes_of_grid(const struct gr_engine *e)
{
    int64_t n = 1;
    for (int d = 0; d < e->config.dim; d++) n *= e->axis[d].n_nodes;
    return n;
}

int gr_shared_contacts_new(struct gr_engine *e)
{
    const int size = e->ranks->transport.size;
    if (!e->config.n_bodies || size == 1) return GR_OK;
    struct gr_shared_contacts *shared = e->ranks->contacts = gr_calloc(1, sizeof *shared);
    if (!shared) return GR_ERR_MEMORY;
    const int64_t numbers = 1 + (int64_t)GR_CONTACT_COUNTS * size + (int64_t)e->config.n_bodies * GR_BODY_NUMBERS;
    shared->letter = gr_calloc((size_t)size, sizeof *shared->letter);
    shared->message = gr_calloc((size_t)size, sizeof *shared->message);
    shared->number = gr_malloc(sizeof *shared->number * (size_t)numbers);
    shared->size = size;
    if (!shared->letter || !shared->message || !shared->number) return GR_ERR_MEMORY;
    return e->ranks->transport.rank ? GR_OK
                                    : gr_table_new(&shared->number_of, (1 + (e->bodies.n_thin > 0)) * nodes_of_grid(e));
}

/* Space for more bytes in a message. */
static char *append(struct letter *letter, int64_t bytes)
{
    if (letter->out_bytes + bytes > letter->out_capacity) {
        const int64_t capacity = 2 * (letter->out_bytes + bytes) + 4096;
        char *more = gr_realloc(letter->out, (size_t)capacity);
        if (!more) return NULL;
        letter->out = more, letter->out_capacity = capacity;
    }
    letter->out_bytes += bytes;
    return letter->out + letter->out_bytes - bytes;
}

static int reserve_in(struct letter *letter, int64_t bytes)
{
    letter->in_bytes = bytes;
    if (bytes <= letter->in_capacity) return GR_OK;
    letter->in_capacity = 0;
    GR_RESIZE(letter->in, bytes + bytes / 2);
    letter->in_capacity = bytes + bytes / 2;
    return GR_OK;
}

/* ---- To rank 0 ---- */

enum { HEAD_BYTES = offsetof(struct gr_contact_point, node) };

/* What is sent of a contact point: the place of its cell in the order of cells, its struct up to its nodes, and the numbers and
 * weights of these. */
static int64_t bytes_of(int n_nodes)
{
    return (int64_t)sizeof(int64_t) + HEAD_BYTES + n_nodes * (int64_t)(sizeof(int32_t) + sizeof(double));
}

static void put(char **at, const void *data, size_t bytes)
{
    memcpy(*at, data, bytes);
    *at += bytes;
}

static void take(const char **at, void *data, size_t bytes)
{
    memcpy(data, *at, bytes);
    *at += bytes;
}

/* Write the own contact points and their nodes. */
static int pack(const struct gr_engine *e, struct letter *letter)
{
    const struct gr_contact_points *of_rank = e->bodies.contacts;
    letter->out_bytes = 0;
    for (int64_t k = 0; k < of_rank->n_nodes; k++) {
        const int64_t n = of_rank->origin[k].n, id = e->mesh.node_id[n];
        struct node node = {.id = id, .node = of_rank->node[k], .origin = of_rank->origin[k]};
        node.behind = (int64_t)gr_table_get(&e->mesh.node_of, id) - 1 != n;
        char *at = append(letter, sizeof node);
        if (!at) return GR_ERR_MEMORY;
        memcpy(at, &node, sizeof node);
    }
    for (int64_t k = 0; k < of_rank->n; k++) {
        const struct gr_contact_point *contact = &of_rank->contact[k];
        const int64_t cell = gr_order_of_cell(e, &e->mesh.cell[contact->lane]);
        const size_t n = (size_t)contact->n_nodes;
        char *at = append(letter, bytes_of(contact->n_nodes));
        if (!at) return GR_ERR_MEMORY;
        put(&at, &cell, sizeof cell);
        put(&at, contact, HEAD_BYTES);
        put(&at, contact->node, n * sizeof *contact->node);
        put(&at, contact->weight, n * sizeof *contact->weight);
    }
    return GR_OK;
}

/* Bytes of a message that are still to be read. */
static int64_t bytes_left(const struct letter *letter) { return letter->in + letter->in_bytes - letter->next; }

/* Look at the cell of the contact point of a rank that is read next. Returned: 0, or GR_ERR_TRANSPORT if there is none. */
static int look(struct letter *letter)
{
    if (bytes_left(letter) < bytes_of(0)) return GR_ERR_TRANSPORT;
    memcpy(&letter->cell, letter->next, sizeof letter->cell);
    return GR_OK;
}

static int reserve_all(struct gr_engine *e)
{
    struct gr_shared_contacts *shared = e->ranks->contacts;
    struct gr_contact_points *all = &shared->all;
    int64_t n = 0, nodes = 0;
    for (int r = 0; r < e->ranks->transport.size; r++) n += shared->letter[r].n, nodes += shared->letter[r].n_nodes;
    if (n > all->capacity) {
        all->capacity = 0;
        GR_RESIZE(all->contact, n + n / 2);
        GR_RESIZE(shared->from, n + n / 2);
        all->capacity = n + n / 2;
    }
    if (nodes > all->node_capacity) {
        all->node_capacity = 0;
        GR_RESIZE(all->node, nodes + nodes / 2);
        GR_RESIZE(all->origin, nodes + nodes / 2);
        all->node_capacity = nodes + nodes / 2;
    }
    all->n = all->n_nodes = 0;
    gr_table_clear(&shared->number_of);
    for (int r = 0; r < e->ranks->transport.size; r++) {
        struct letter *letter = &shared->letter[r];
        if (letter->n_nodes > letter->number_capacity) {
            letter->number_capacity = 0;
            GR_RESIZE(letter->number, letter->n_nodes + letter->n_nodes / 2);
            letter->number_capacity = letter->n_nodes + letter->n_nodes / 2;
        }
        for (int64_t k = 0; k < letter->n_nodes; k++) letter->number[k] = -1;
        letter->node = letter->in;
        letter->next = letter->in + letter->n_nodes * (int64_t)sizeof(struct node);
        letter->read = 0;
        if (letter->n && look(letter)) return GR_ERR_TRANSPORT;
    }
    return GR_OK;
}

/* True if a message can hold a node of this grid. */
static int node_is_valid(const struct gr_engine *e, const struct node *node)
{
    return node->id >= 0 && node->id < nodes_of_grid(e) && (node->behind == 0 || (node->behind == 1 && e->bodies.n_thin));
}

/* Find the number in the list of all of node *k of a rank, which takes its place. */
static int number_node(struct gr_engine *e, struct letter *letter, int32_t *k)
{
    struct gr_shared_contacts *shared = e->ranks->contacts;
    struct gr_contact_points *all = &shared->all;
    struct node node;
    if (*k < 0 || *k >= letter->n_nodes) return GR_ERR_TRANSPORT;
    int32_t *const known = &letter->number[*k];
    if ((*k = *known) >= 0) return GR_OK;
    memcpy(&node, letter->node + (known - letter->number) * (int64_t)sizeof node, sizeof node);
    if (!node_is_valid(e, &node)) return GR_ERR_TRANSPORT;
    const int64_t place = node.id + node.behind * nodes_of_grid(e);
    int32_t number = gr_table_get(&shared->number_of, place) - 1;
    if (number < 0) {
        number = (int32_t)all->n_nodes;
        if (gr_table_set(&shared->number_of, place, number + 1)) return GR_ERR_MEMORY;
        all->node[number] = node.node;
        all->origin[number] = node.origin;
        all->origin[number].n = place;
        all->n_nodes++;
    }
    *k = *known = number;
    return GR_OK;
}

/* Read the next contact point of a rank. */
static int read_contact(struct gr_engine *e, int r)
{
    struct gr_shared_contacts *shared = e->ranks->contacts;
    struct letter *letter = &shared->letter[r];
    struct gr_contact_point *contact = &shared->all.contact[shared->all.n];
    const char *at = letter->next + sizeof letter->cell;
    take(&at, contact, HEAD_BYTES);
    if (contact->n_nodes < 0 || contact->n_nodes > GR_MAX_NODES || bytes_left(letter) < bytes_of(contact->n_nodes) ||
        contact->body < 0 || contact->body >= e->config.n_bodies)
        return GR_ERR_TRANSPORT;
    const size_t n = (size_t)contact->n_nodes;
    take(&at, contact->node, n * sizeof *contact->node);
    take(&at, contact->weight, n * sizeof *contact->weight);
    int error = GR_OK;
    for (size_t i = 0; i < n && !error; i++) error = number_node(e, letter, &contact->node[i]);
    if (error) return error;
    shared->from[shared->all.n++] = r;
    letter->next = at;
    letter->read++;
    return letter->read < letter->n ? look(letter) : GR_OK;
}

/* Put the contact points of all ranks into the order of their cells; those of a cell are of one rank, in their order. */
static int merge(struct gr_engine *e)
{
    struct letter *letter = e->ranks->contacts->letter;
    int error = reserve_all(e);
    while (!error) {
        int first = -1;
        int64_t limit = INT64_MAX; /* where another rank has the next one */
        for (int r = 0; r < e->ranks->transport.size; r++) {
            if (letter[r].read == letter[r].n) continue;
            if (first >= 0 && letter[r].cell > letter[first].cell) {
                limit = letter[r].cell < limit ? letter[r].cell : limit;
                continue;
            }
            if (first >= 0) limit = letter[first].cell;
            first = r;
        }
        if (first < 0) return GR_OK;
        while (!error && letter[first].read < letter[first].n && letter[first].cell < limit) error = read_contact(e, first);
    }
    return error;
}

/* Add up numbers over all ranks, the first of which counts errors. */
static int add_up(struct gr_engine *e, int error, int64_t n)
{
    struct gr_ranks *ranks = e->ranks;
    int64_t *number = ranks->contacts->number;
    number[0] = error != GR_OK;
    if (gr_ranks_add_up(ranks, number, n)) return error ? error : GR_ERR_TRANSPORT;
    return error ? error : number[0] ? GR_ERR_ELSEWHERE : GR_OK;
}

/* Exchange the letters with rank 0. */
static int exchange(struct gr_engine *e)
{
    struct gr_shared_contacts *shared = e->ranks->contacts;
    const int me = e->ranks->transport.rank, size = e->ranks->transport.size;
    int n = 0;
    for (int r = 0; r < size; r++) {
        const struct letter *letter = &shared->letter[r];
        if (r == me || (me && r)) continue;
        if (!letter->out_bytes && !letter->in_bytes) continue;
        shared->message[n++] = (struct gr_message){r, letter->out_bytes, letter->in_bytes, letter->out, letter->in};
    }
    return gr_ranks_send(e->ranks, shared->message, n);
}

int gr_gather_contacts(struct gr_engine *e)
{
    if (!is_shared(e)) return GR_OK;
    const int me = e->ranks->transport.rank, size = e->ranks->transport.size;
    struct gr_shared_contacts *shared = e->ranks->contacts;
    int64_t *const count = shared->number + 1;
    struct letter *letter = shared->letter;
    int error = pack(e, &letter[0]);
    memset(count, 0, sizeof *count * (size_t)(GR_CONTACT_COUNTS * size));
    int64_t *const mine = count + (int64_t)GR_CONTACT_COUNTS * me;
    mine[GR_CONTACTS] = e->bodies.contacts->n;
    mine[GR_CONTACT_NODES] = e->bodies.contacts->n_nodes;
    mine[GR_CONTACT_BYTES] = letter[0].out_bytes;
    if ((error = add_up(e, error, 1 + (int64_t)GR_CONTACT_COUNTS * size))) return error;
    for (int r = 0; r < size && !error && !me; r++) {
        letter[r].n = count[GR_CONTACT_COUNTS * r + GR_CONTACTS];
        letter[r].n_nodes = count[GR_CONTACT_COUNTS * r + GR_CONTACT_NODES];
        const int64_t bytes = count[GR_CONTACT_COUNTS * r + GR_CONTACT_BYTES];
        if (r) letter[r].out_bytes = 0;
        if (letter[r].n < 0 || letter[r].n > INT32_MAX || letter[r].n_nodes < 0 || letter[r].n_nodes > INT32_MAX ||
            bytes < letter[r].n_nodes * (int64_t)sizeof(struct node))
            error = GR_ERR_TRANSPORT; /* messages are confused */
        else
            error = reserve_in(&letter[r], bytes);
    }
    if (me) letter[0].in_bytes = 0;
    error = gr_ranks_agree(e, error, NULL, 0);
    if (error) return error;
    if (!me && letter[0].out_bytes) memcpy(letter[0].in, letter[0].out, (size_t)letter[0].out_bytes);
    error = exchange(e);
    return error || me ? error : merge(e);
}

/* ---- From rank 0 ---- */

/* Write the results for all ranks. */
static int pack_results(struct gr_engine *e)
{
    struct gr_shared_contacts *shared = e->ranks->contacts;
    const struct gr_contact_points *all = &shared->all;
    const int64_t in_layer = nodes_of_grid(e);
    int rank[GR_MOST_NEAR];
    for (int r = 0; r < e->ranks->transport.size; r++) shared->letter[r].out_bytes = shared->letter[r].n_nodes = 0;
    for (int64_t k = 0; k < all->n; k++) {
        const struct gr_contact_point *contact = &all->contact[k];
        const struct result result = {{contact->impulse[0], contact->impulse[1], contact->impulse[2]}, contact->pressing};
        char *at = append(&shared->letter[shared->from[k]], sizeof result);
        if (!at) return GR_ERR_MEMORY;
        memcpy(at, &result, sizeof result);
    }
    for (int64_t k = 0; k < all->n_nodes; k++) {
        const int64_t place = all->origin[k].n;
        const struct node node = {place % in_layer, place >= in_layer, all->node[k], all->origin[k]};
        const int n = gr_ranks_of_node(e, node.id, rank);
        for (int i = 0; i < n; i++) {
            char *at = append(&shared->letter[rank[i]], sizeof node);
            if (!at) return GR_ERR_MEMORY;
            memcpy(at, &node, sizeof node);
            shared->letter[rank[i]].n_nodes++;
        }
    }
    return GR_OK;
}

/* Take the results for the own contact points and nodes; nodes that are not in the mesh are passed over. */
static void unpack_results(struct gr_engine *e, const char *at, int64_t n_nodes)
{
    struct gr_contact_points *of_rank = e->bodies.contacts;
    for (int64_t k = 0; k < of_rank->n_nodes; k++) of_rank->number[of_rank->origin[k].n] = 0;
    for (int64_t k = 0; k < of_rank->n; k++) {
        struct result result;
        take(&at, &result, sizeof result);
        memcpy(of_rank->contact[k].impulse, result.impulse, sizeof result.impulse);
        of_rank->contact[k].pressing = result.pressing;
    }
    of_rank->n_nodes = 0;
    for (int64_t k = 0; k < n_nodes; k++) {
        struct node node;
        take(&at, &node, sizeof node);
        if (!node_is_valid(e, &node)) continue;
        int64_t n = (int64_t)gr_table_get(&e->mesh.node_of, node.id) - 1;
        if (n >= 0 && node.behind) n = e->mesh.duplicate[n];
        if (n < 0 || of_rank->n_nodes == of_rank->node_capacity) continue;
        node.origin.n = n;
        of_rank->node[of_rank->n_nodes] = node.node;
        of_rank->origin[of_rank->n_nodes++] = node.origin;
    }
}

int gr_scatter_contacts(struct gr_engine *e, int error)
{
    if (!is_shared(e) || e->ranks->failed) return error;
    struct gr_shared_contacts *shared = e->ranks->contacts;
    const int me = e->ranks->transport.rank, size = e->ranks->transport.size;
    const size_t words = (size_t)e->config.n_bodies * GR_BODY_NUMBERS; /* their bits, as integers */
    int64_t *const count = shared->number + 1, *const bodies = count + 2 * (int64_t)size;
    if (!me && !error) error = pack_results(e);
    memset(count, 0, sizeof *count * (2 * (size_t)size + words));
    for (int r = 0; r < size && !me; r++) {
        count[2 * r] = shared->letter[r].n_nodes;
        count[2 * r + 1] = shared->letter[r].out_bytes;
    }
    if (!me) memcpy(bodies, e->bodies.next, words * sizeof *bodies);
    if ((error = add_up(e, error, 1 + 2 * (int64_t)size + (int64_t)words))) return error;
    memcpy(e->bodies.next, bodies, words * sizeof *bodies);
    for (int r = 0; r < size && !me; r++) shared->letter[r].in_bytes = 0;
    if (me) shared->letter[0].out_bytes = 0;
    const int64_t nodes = count[2 * me], bytes = count[2 * me + 1];
    const int64_t results = e->bodies.contacts->n * (int64_t)sizeof(struct result);
    if (nodes < 0 || nodes > INT32_MAX || bytes != results + nodes * (int64_t)sizeof(struct node)) error = GR_ERR_TRANSPORT;
    if (me && !error) error = reserve_in(&shared->letter[0], bytes);
    error = gr_ranks_agree(e, error, NULL, 0);
    if (!error) error = exchange(e);
    if (!error) unpack_results(e, me ? shared->letter[0].in : shared->letter[0].out, nodes);
    return error;
}
