/* What is added to the nodes (addends.h). */
#include "mpm/addends.h"

#include "core/memory.h"
#include "mpm/cell_sums.h"
#include "mpm/device.h"
#include "mpm/places.h"

/* A row of active nodes along the first axis, and the number of addends of each row of the nodes of cells to them; then where
 * these begin. */
struct line {
    int64_t n[9];
    int32_t node;
};

/* What is being listed: first the addends are counted; then there is memory for them. */
struct listing {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, n_front;
    struct line *line;
    int64_t n_lines, *lines_of; /* per chunk of the nodes: lines that begin in it, then those that begin before */
    struct gr_addend *out;      /* NULL while they are counted */
};

/* Lanes that are a run: they add to n nodes of a row from `node` on; what is at their `end` is added to the nodes `next`
 * beyond, and `before` to the first of these (find_before). With linear functions there is one node beyond. */
struct run {
    int64_t first, end, before;
    int n;
    int32_t node, next[2]; /* -1 for a node that is not there, or that the end is not added to */
    uint8_t kind_1, kind_3, kind_before;
};

/* A row of cells that is being added to a row of nodes, which is row `row` of the nodes of its cells; the number of addends
 * so far. */
struct adding {
    const struct gr_engine *e;
    int row, k;
    int64_t end;                 /* of the row of cells */
    struct gr_addend *out, last; /* `last`: what has been added; of 0 nodes at first */
    int64_t n;
};

/* ---- Rows of nodes, and of cells ---- */

/* True if node n is the first in its row, of its layer. */
static int begins_line(const struct gr_engine *e, const struct listing *l, int64_t n)
{
    const int64_t n_x = e->axis[0].n_nodes, *id = e->mesh.node_id;
    return !n || n == l->n_front || id[n] / n_x != id[n - 1] / n_x;
}

GR_DEFINE_PASS(count_lines, struct listing, l)
{
    int64_t count = 0;
    for (int64_t n = first; n < last; n++) count += begins_line(e, l, n);
    l->lines_of[chunk] = count;
}

/* List the rows of nodes. */
GR_DEFINE_PASS(list_lines, struct listing, l)
{
    int64_t k = l->lines_of[chunk];
    for (int64_t n = first; n < last; n++)
        if (begins_line(e, l, n)) l->line[k++] = (struct line){.node = (int32_t)n};
}

/* Number of the first cell of a layer that is in a row of cells not before this one. */
static int64_t first_cell_of(const struct gr_engine *e, int behind, int64_t row)
{
    int64_t low = behind ? e->mesh.n_front : 0, high = behind ? e->mesh.n_cells : e->mesh.n_front;
    while (low < high) {
        const int64_t middle = (low + high) / 2;
        const int32_t *at = e->mesh.cell[middle].at;
        if ((int64_t)at[2] * e->axis[1].n_cells + at[1] < row)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* ---- Runs ---- */

/* Find the run that begins with lane c. */
static struct run run_from(const struct adding *a, int64_t c)
{
    const struct gr_mesh *mesh = &a->e->mesh;
    const unsigned joins = mesh->tile_joins[c / GR_LANES];
    struct run run = {.first = c, .n = 1, .next = {-1, -1}};
    while (c + run.n < a->end && (c + run.n) % GR_LANES && joins >> (c + run.n) % GR_LANES & 1) run.n++;
    run.node = gr_node_in_row(a->e, c, a->row, 0);
    for (int j = 0; j < a->k - 1; j++) run.next[j] = gr_node_in_row(a->e, c + run.n - 1, a->row, j + 1);
    run.end = gr_end_of_run(a->e, c);
    run.kind_1 = joins ? GR_TAIL_1 : GR_SECOND;
    if (a->k == 3) run.kind_3 = joins ? GR_TAIL_3 : GR_THIRD;
    return run;
}

/* Find what is added to the first node beyond a run in addition to its s_1: the s_2 of its last but one lane, which is in the
 * run before if it has but one. */
static void find_before(const struct adding *a, struct run *run, const struct run *last)
{
    if (a->k == 2) return;
    if (run->n > 1) {
        run->before = run->end;
        run->kind_before = GR_TAIL_2;
    } else if (last->next[1] == run->next[0]) {
        run->before = last->end;
        run->kind_before = last->kind_3;
    }
}

/* Find the run at the end of a row of cells, if it has nodes across the periodic end of the row.
 * Returned: whether it has. */
static int find_closing(const struct adding *a, int64_t begin, struct run *closing)
{
    const int x = a->e->mesh.cell[a->end - 1].at[0];
    struct run last = {.next = {-1, -1}};
    if (!a->e->mesh.row_begin || x + a->k <= a->e->axis[0].n_nodes) return 0;
    for (int64_t c = begin; c < a->end; c += closing->n) {
        last = *closing;
        *closing = run_from(a, c);
    }
    find_before(a, closing, closing->first == begin ? closing : &last);
    return 1;
}

/* ---- What is added ---- */

/* True if the lane of an addend follows those of another in all that is added. */
static int follows(const struct gr_addend *a, const struct gr_addend *b)
{
    return a->apart && b->apart && b->node == a->node + a->n && b->lanes == a->lanes + a->n && b->first == a->first &&
           b->kind_before == a->kind_before && (!b->first || b->end == a->end + a->n) &&
           (!b->kind_before || b->before == a->before + a->n);
}

/* Add an addend, to the last one if its lane, a run by itself, follows those. */
static void add(struct adding *a, struct gr_addend addend)
{
    if (a->last.n && follows(&a->last, &addend)) {
        a->last.n++;
        if (a->out) a->out[a->n - 1].n++;
        return;
    }
    if (a->out) a->out[a->n] = addend;
    a->last = addend;
    a->n++;
}

/* Add the end of a run to the nodes beyond it where no other run begins with the first of them. If one begins with the
 * second, at `node`, that is left to it. */
static void add_end(struct adding *a, const struct run *run, int32_t node)
{
    struct gr_addend addend = {
        .end = run->end, .before = run->before, .first = run->kind_1, .kind_before = run->kind_before};
    if (run->next[0] >= 0) {
        const int two = a->k == 3 && run->next[1] >= 0 && run->next[1] != node;
        addend.node = run->next[0];
        addend.n = two ? 2 : 1;
        addend.second = two ? run->kind_3 : GR_NO_SUM;
        add(a, addend);
    } else if (a->k == 3 && run->next[1] >= 0 && run->next[1] != node) {
        add(a, (struct gr_addend){.before = run->end, .node = run->next[1], .n = 1, .kind_before = run->kind_3});
    }
}

/* Add a run to its nodes, and the end of the last run to the first of them. */
static void add_run(struct adding *a, const struct run *run, const struct run *last)
{
    const int64_t lane = run->first % GR_LANES;
    struct gr_addend addend = {.lanes = a->e->mesh.tile_block[run->first / GR_LANES] + lane,
                               .node = run->node,
                               .n = (uint8_t)run->n,
                               .apart = run->kind_1 == GR_SECOND,
                               .kind_of_lanes = GR_OF_LANES};
    if (last->next[0] == run->node) {
        addend.end = last->end, addend.first = last->kind_1;
        addend.second = run->n > 1 ? last->kind_3 : GR_NO_SUM;
        addend.before = last->before, addend.kind_before = last->kind_before;
    } else {
        add_end(a, last, run->node);
        if (last->next[1] == run->node) addend.before = last->end, addend.kind_before = last->kind_3;
    }
    add(a, addend);
}

/* Add a row of cells, from `begin` to a->end, to a row of nodes. */
static void add_cells(struct adding *a, int64_t begin)
{
    const int n_x = a->e->axis[0].n_nodes;
    struct run last = {.next = {-1, -1}}, run;
    const int x = a->e->mesh.cell[a->end - 1].at[0], closes = find_closing(a, begin, &last);
    for (int j = 0; closes && j < a->k - 1; j++) /* those across the end come first */
        if (x + j + 1 < n_x) last.next[j] = -1;
    for (int64_t c = begin; c < a->end; c += run.n) {
        run = run_from(a, c);
        find_before(a, &run, &last);
        add_run(a, &run, &last);
        last = run;
    }
    for (int j = 0; closes && j < a->k - 1; j++)
        if (x + j + 1 >= n_x) last.next[j] = -1;
    add_end(a, &last, -1);
}

/* Count the addends of rows of nodes, or list them: an item is a row of nodes and one of the rows of cells about it. */
GR_DEFINE_PASS(list_addends, struct listing, l)
{
    const struct gr_node_cells flat = {.count = 1};
    const int k = e->K / e->n_rows;
    for (int64_t item = first; item < last; item++) {
        struct line *const line = &l->line[item / e->n_rows];
        const int b = (int)(item % e->n_rows) % k, c = (int)(item % e->n_rows) / k, behind = line->node >= l->n_front;
        const int64_t row = e->mesh.node_id[line->node] / e->axis[0].n_nodes, n_y = e->axis[1].n_nodes;
        const struct gr_node_cells *y = &e->cells_of_node[1][row % n_y];
        const struct gr_node_cells *z = e->config.dim == 3 ? &e->cells_of_node[2][row / n_y] : &flat;
        if (b >= y->count || c >= z->count) continue;
        const int64_t cells = (int64_t)z->cell[c] * e->axis[1].n_cells + y->cell[b];
        const int64_t begin = first_cell_of(e, behind, cells);
        struct adding adding = {.e = e, .row = y->local[b] + k * z->local[c], .k = k, .out = l->out};
        adding.end = first_cell_of(e, behind, cells + 1);
        if (l->out) adding.n = line->n[adding.row];
        if (begin < adding.end) add_cells(&adding, begin);
        if (!l->out) line->n[adding.row] = adding.n;
    }
}

#ifndef GR_ON_DEVICE
/* List the rows of nodes. */
static int find_lines(struct listing *l)
{
    struct gr_engine *e = l->e;
    const int64_t pieces = gr_pass_chunks(e, e->mesh.n_nodes, l->chunks);
    l->lines_of = gr_malloc(sizeof *l->lines_of * (size_t)(pieces + 1));
    if (!l->lines_of) return GR_ERR_MEMORY;
    GR_MAKE_IN(count_lines, l, e->mesh.n_nodes, pieces);
    const int error = gr_make_places(e, l->lines_of, pieces, &l->n_lines);
    if (error) return error;
    l->line = gr_malloc(sizeof *l->line * (size_t)(l->n_lines + 1));
    if (!l->line) return GR_ERR_MEMORY;
    GR_MAKE_IN(list_lines, l, e->mesh.n_nodes, pieces);
    return GR_OK;
}

/* Give the addends of each row and line their places.
 * Returned: their number. */
static int64_t place_addends(struct listing *l)
{
    int64_t n = 0;
    for (int row = 0; row < l->e->n_rows; row++) {
        l->e->mesh.row_addends[row] = n;
        for (struct line *line = l->line; line < l->line + l->n_lines; line++) {
            const int64_t more = line->n[row];
            line->n[row] = n;
            n += more;
        }
    }
    return l->e->mesh.row_addends[l->e->n_rows] = n;
}

static int list(struct listing *l)
{
    struct gr_mesh *mesh = &l->e->mesh;
    int error = find_lines(l);
    if (error) return error;
    GR_MAKE(list_addends, l, l->n_lines * l->e->n_rows);
    error = gr_device_wait(l->e);
    if (error) return error;
    const int64_t n = place_addends(l);
    if (n > mesh->addend_capacity) {
        mesh->addend_capacity = 0;
        GR_RESIZE(mesh->addend, n + n / 2);
        mesh->addend_capacity = n + n / 2;
    }
    l->out = mesh->addend;
    GR_MAKE(list_addends, l, l->n_lines * l->e->n_rows);
    return gr_device_wait(l->e);
}

int gr_list_addends(struct gr_engine *e, int64_t n_front, struct gr_team *team, int64_t chunks)
{
    struct listing l = {.e = e, .team = team, .chunks = chunks, .n_front = n_front};
    const int error = list(&l);
    gr_free(l.lines_of);
    gr_free(l.line);
    return error;
}
#endif
