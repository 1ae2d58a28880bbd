/* Ranks: processes that share one run.
 *
 * The cells of the grid are divided into blocks, each with an owner; with a nonlocal law into runs of GR_RUN_OF_CELLS, which
 * are the chunks of the fluidity grid. A rank has the points of its own cells. Its mesh has
 * these cells and, as ghost cells without points, those of others that reach the same nodes. In each step it receives the
 * sums of its ghost cells from their owners, and so has the full sums of all nodes of its own cells: these do the same
 * there as on any other rank that has them, with the same bits.
 *
 * The sum of a node is one over rows of cells, of the sums in each row, wherever a tile begins (engine.h). What is sent are
 * these sums of rows; of each cell by itself where several ranks have cells of the row. For those to be there, each lane of a
 * tile with such a cell is a run by itself.
 *
 * Bodies, inlets and the calm of cells are the same on all ranks: what changes them is agreed on in each step. */
#pragma once

#include "core/exact.h"
#include "core/transport.h"
#include "mpm/engine.h"

/* Which ranks have a cell in their meshes: others alone; this one alone, which owns it; or this one and others, of which it owns
 * it, or another one. */
enum gr_sharing { GR_NOT_HERE, GR_ALONE, GR_SHARED_OWN, GR_GHOST };

/* An own cell that another rank has as a ghost, or a ghost that is its cell. */
struct gr_shared_cell {
    int64_t lane;
    int occupied; /* of a ghost: whether it has points, as of the last exchange of calm */
};

/* The sums of a node over a row of cells of one rank, or over one cell, as what is added up of the runs: (s[0] + s[1]) + s[2].
 * One that comes from another rank goes to the place of s[0]. */
struct gr_shared_sum {
    int64_t at[3];
    uint8_t kind[3], row; /* enum gr_kind_of_sum; row of the nodes of the cells */
};

/* Those that are sent to a rank, or come from there; the first `of_motion` of them in each step, all of them in one that averages
 * the density. */
struct gr_shared_sums {
    struct gr_shared_sum *sum;
    int64_t n, of_motion, capacity;
};

/* Another rank with cells so near that they matter here. */
struct gr_peer {
    int rank;
    struct gr_shared_cell *own, *ghost; /* own cells that it has as ghosts; ghosts that are its cells; ascending */
    int64_t n_own, n_ghost;             /* how many of them */
    int64_t own_capacity, ghost_capacity;
    struct gr_shared_sums leaving, arriving;
    int64_t n_leaving, n_arriving; /* points that go there in this step, and come from there */
    char *out, *in;                /* messages */
    int64_t out_capacity, in_capacity;
};

enum { GR_RUN_OF_CELLS = GR_CHUNK_PAGES * GR_PAGE };

struct gr_ranks {
    struct gr_transport transport;
    int reach, farther; /* distance of a cell, in cells, within which others reach the nodes that it needs; near bodies */
    struct gr_split_pose *pose; /* of the bodies when the points were grouped; NULL without bodies */
    int edge;                   /* cells of a block along each axis; 0: blocks are runs of cells */
    int64_t n_blocks[3];        /* blocks along each axis */
    int64_t n_cells[3];         /* cells along each axis */
    int32_t *owner;             /* of each block */
    int32_t *cell_of_number[3]; /* per number of a node along an axis: a cell with all nodes that have it */
    struct gr_peer *peer;
    int n_peers;
    uint8_t *sharing; /* of each active cell: enum gr_sharing */
    int64_t sharing_capacity;
    int grouped; /* whether the mesh fits those of the others */
    int failed;  /* whether a message has failed */
    struct gr_message *message;
    int64_t *number; /* work space of gr_ranks_combine */
    int number_capacity;
    /* points that have come in a step, and the parts of the lists of all migrants in their order */
    struct gr_migrant *arrival;
    double *record, *staged;
    int64_t *id, *order, *staged_id;
    int64_t n_arrivals, arrival_capacity, staged_capacity, part_capacity;
    struct gr_migrants *part;
    /* points that enter in a step: whether the position of each candidate is occupied, and the positions of those so far */
    int64_t *taken, n_entered, entering_capacity;
    double *entered;
    struct gr_fluidity_ranks fluidity;
    struct gr_shared_contacts *contacts;     /* contact/shared_contacts.h; NULL without bodies */
    int64_t sent_bytes;                      /* since the beginning, as the times */
    double seconds_waiting, seconds_copying; /* for messages; numbers of ghost cells into messages and out of them */
};

/* Distances in cells within which a rank needs the full sums of nodes, or the values of cells: of an averaging of the density;
 * of contact points, which are nearer to their points than 1.5 cells; of the links of the isotropic stencil of the fluidity. */
enum { GR_REACH_OF_AVERAGES = 1, GR_REACH_OF_BODIES = 2, GR_REACH_OF_LINKS = 2 };

/* The owner of a cell. */
static inline int gr_owner(const struct gr_ranks *ranks, const int32_t at[3])
{
    const int64_t *n = ranks->n_blocks;
    const int edge = ranks->edge;
    if (!edge) return ranks->owner[((at[2] * ranks->n_cells[1] + at[1]) * ranks->n_cells[0] + at[0]) / GR_RUN_OF_CELLS];
    return ranks->owner[((int64_t)(at[2] / edge) * n[1] + at[1] / edge) * n[0] + at[0] / edge];
}

/* True if the cells from x = `first` to `last` of the row of a cell that are in the grid belong to one rank, and their nodes
 * follow each other. */
static inline int gr_is_of_one_rank(const struct gr_engine *e, const int32_t at[3], int64_t first, int64_t last)
{
    const struct gr_axis *axis = &e->axis[0];
    const int owner = gr_owner(e->ranks, at);
    if (axis->periodic && (first < 0 || last >= axis->n_cells)) return 0;
    if (first < 0) first = 0;
    if (last >= axis->n_cells) last = axis->n_cells - 1;
    for (int64_t x = first; x <= last; x++) {
        const int32_t near[3] = {(int32_t)x, at[1], at[2]};
        if (gr_owner(e->ranks, near) != owner) return 0;
        if (x > first && axis->cell[x].node[0] != axis->cell[x - 1].node[0] + 1) return 0;
    }
    return 1;
}

/* Place of a cell in the order of the cells of meshes: that of the grid, and those behind thin bodies last. */
static inline int64_t gr_order_of_cell(const struct gr_engine *e, const struct gr_cell *cell)
{
    int64_t n = cell->side < 0;
    for (int d = 0; d < e->config.dim; d++) n *= e->axis[d].n_cells;
    return gr_cell_id(e, cell->at) + n;
}

/* Wall-clock time, s. */
double gr_ranks_clock(void);

/* Share a run. Given: an engine without points; the edge of the blocks, 0 for runs of cells, which a nonlocal law needs, and the
 * owner of each, x fastest.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_CONFIG. */
int gr_ranks_new(struct gr_engine *e, const struct gr_transport *transport, int edge, const int32_t *owner);
void gr_ranks_free(struct gr_ranks *ranks);

/* Number of blocks along an axis. */
int64_t gr_ranks_blocks(const struct gr_engine *e, int d, int edge);

/* Agree on an error and on flags, which are added up over all ranks. Returned: the error of this rank; GR_ERR_CAPACITY if
 * another one has only that; else GR_ERR_ELSEWHERE if another one has an error. */
int gr_ranks_agree(struct gr_engine *e, int error, int64_t *flags, int n);

/* Add up n exact sums, and find the largest of m numbers; agree on an error. */
int gr_ranks_combine(struct gr_engine *e, int error, struct gr_exact *sum, int n, double *largest, int m);

/* Add up n integers over all ranks. Returned: 0 or GR_ERR_TRANSPORT. */
int gr_ranks_add_up(struct gr_ranks *ranks, int64_t *number, int64_t n);

/* Replace a number by the largest of all ranks. If a message fails, the next agreement says so. */
void gr_ranks_find_largest(const struct gr_engine *e, double *number);

/* Send messages to any ranks, and receive theirs. Returned: 0 or GR_ERR_TRANSPORT. */
int gr_ranks_send(struct gr_ranks *ranks, const struct gr_message *message, int n);

/* Send what the messages of the peers hold, and receive what they expect. Returned: 0 or GR_ERR_TRANSPORT. */
int gr_ranks_exchange(struct gr_engine *e);

/* Exchange how many things leave for each peer, n_leaving, and how many arrive. Returned: 0 or GR_ERR_TRANSPORT. */
int gr_ranks_exchange_counts(struct gr_engine *e);

/* The message to and from peer k, with space for so many bytes. Returned: 0 or GR_ERR_MEMORY. */
int gr_ranks_reserve(struct gr_ranks *ranks, int k, int64_t out_bytes, int64_t in_bytes);

/* Most ranks near a cell: of 4 blocks along each axis, as a distance is at most that of 1.5 blocks; or of two runs in each of
 * 13 x 13 rows. */
enum { GR_MOST_NEAR = 2 * 13 * 13 };

/* True if this rank adds up the impulses on the nodes with these numbers (gr_node_numbers), of all of which it has the full
 * sums: beyond an end of the domain several have one number. */
int gr_ranks_has_number(const struct gr_engine *e, const int32_t at[3]);

/* True if contact points may act on nodes of a cell, or of another one in its row if `row`, before the points are grouped again. */
int gr_ranks_near_body(const struct gr_engine *e, const int32_t at[3], int row);

/* Note where the bodies are; and whether one has moved so far since then that the points must be grouped again. */
void gr_ranks_note_bodies(struct gr_engine *e);
int gr_ranks_bodies_moved(const struct gr_engine *e);

/* The ranks that have a cell in their meshes: its owner, first, and those for which it is near enough. Returned: their number. */
int gr_ranks_having(const struct gr_engine *e, const int32_t at[3], int rank[GR_MOST_NEAR]);

/* The ranks that own a cell, or one within a distance of it, each once; the owner of the cell first.
 * Returned: their number. */
int gr_ranks_near(const struct gr_engine *e, const int32_t at[3], int distance, int rank[GR_MOST_NEAR]);

/* The ranks that own a cell with the node `id` of the grid, each once. Returned: their number. */
int gr_ranks_of_node(const struct gr_engine *e, int64_t id, int rank[GR_MOST_NEAR]);

/* Add the ranks that own a cell of the box from `low` to `high`, across periodic ends, to n others. Returned: their number. */
int gr_ranks_in(const struct gr_engine *e, const int64_t low[3], const int64_t high[3], int rank[GR_MOST_NEAR], int n);

/* True if a cell along the first axis from a cell, so near that they have a node in common, may belong to another rank, or their
 * nodes do not follow each other. */
static inline int gr_is_mixed(const struct gr_engine *e, const int32_t at[3])
{
    const int k = gr_basis_nodes_1d(e->config.basis);
    return !gr_is_of_one_rank(e, at, at[0] - (k - 1), at[0] + k - 1);
}

/* True if so does one of the cells of the node number a in a row of nodes of a cell. */
int gr_node_is_mixed(const struct gr_engine *e, const int32_t at[3], int a);

/* How the cell `id` of the grid is shared, where it is active. */
enum gr_sharing gr_sharing_of(const struct gr_engine *e, int64_t id);

/* Reserve memory for the sharing of n active cells. Returned: 0 or GR_ERR_MEMORY. */
int gr_ranks_reserve_sharing(struct gr_ranks *ranks, int64_t n);

/* Add the cells of other ranks that hold points and are near to this one to the n own ones, both ascending.
 * Returned: 0 or an error; `all`, *n_all, to be freed by the caller. */
int gr_ranks_list_occupied(struct gr_engine *e, const int64_t *own, int64_t n, int64_t **all, int64_t *n_all);
