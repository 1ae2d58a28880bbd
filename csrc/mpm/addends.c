/* What is added to the nodes (addends.h). */
#include "mpm/addends.h"

#include "core/memory.h"
#include "mpm/cell_sums.h"

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
    int64_t n_lines;
    struct gr_addend *out; /* NULL while they are counted */
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
    int64_t last; /* the end of the row of cells */
    struct gr_addend *out;
    int64_t n;
};

/* ---- Rows of nodes, and of cells ---- */

/* List the rows of nodes. */
static int list_lines(struct listing *l)
{
    const struct gr_mesh *mesh = &l->e->mesh;
    const int64_t n_x = l->e->axis[0].n_nodes;
    int64_t end = 0, capacity = 0;
    for (int64_t n = 0; n < mesh->n_nodes; n++) {
        if (n && n != l->n_front && mesh->node_id[n] < end) continue;
        if (l->n_lines == capacity) {
            capacity = 2 * capacity + 16;
            GR_RESIZE(l->line, capacity);
        }
        l->line[l->n_lines++] = (struct line){.node = (int32_t)n};
        end = (mesh->node_id[n] / n_x + 1) * n_x;
    }
    return GR_OK;
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
    while (c + run.n < a->last && (c + run.n) % GR_LANES && joins >> (c + run.n) % GR_LANES & 1) run.n++;
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
    const int x = a->e->mesh.cell[a->last - 1].at[0];
    struct run last = {.next = {-1, -1}};
    if (!a->e->mesh.row_begin || x + a->k <= a->e->axis[0].n_nodes) return 0;
    for (int64_t c = begin; c < a->last; c += closing->n) {
        last = *closing;
        *closing = run_from(a, c);
    }
    find_before(a, closing, closing->first == begin ? closing : &last);
    return 1;
}

/* ---- What is added ---- */

static void add(struct adding *a, struct gr_addend addend)
{
    if (a->out) a->out[a->n] = addend;
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

/* Add a row of cells, from `begin` to a->last, to a row of nodes. */
static void add_cells(struct adding *a, int64_t begin)
{
    const int n_x = a->e->axis[0].n_nodes;
    struct run last = {.next = {-1, -1}}, run;
    const int x = a->e->mesh.cell[a->last - 1].at[0], closes = find_closing(a, begin, &last);
    for (int j = 0; closes && j < a->k - 1; j++) /* those across the end come first */
        if (x + j + 1 < n_x) last.next[j] = -1;
    for (int64_t c = begin; c < a->last; c += run.n) {
        run = run_from(a, c);
        find_before(a, &run, &last);
        add_run(a, &run, &last);
        last = run;
    }
    for (int j = 0; closes && j < a->k - 1; j++)
        if (x + j + 1 >= n_x) last.next[j] = -1;
    add_end(a, &last, -1);
}

/* Count the addends of rows of nodes, or list them. */
GR_SHARED(list_addends, struct listing, l->n_lines, l)
{
    static const struct gr_node_cells flat = {.count = 1};
    const struct gr_engine *e = l->e;
    const int k = e->K / e->n_rows;
    (void)chunk;
    for (struct line *line = l->line + first; line < l->line + last; line++) {
        const int64_t row = e->mesh.node_id[line->node] / e->axis[0].n_nodes, n_y = e->axis[1].n_nodes;
        const struct gr_node_cells *y = &e->cells_of_node[1][row % n_y];
        const struct gr_node_cells *z = e->config.dim == 3 ? &e->cells_of_node[2][row / n_y] : &flat;
        const int behind = line->node >= l->n_front;
        for (int c = 0; c < z->count; c++)
            for (int b = 0; b < y->count; b++) {
                const int64_t cells = (int64_t)z->cell[c] * e->axis[1].n_cells + y->cell[b];
                const int64_t begin = first_cell_of(e, behind, cells);
                struct adding adding = {.e = e, .row = y->local[b] + k * z->local[c], .k = k, .out = l->out};
                adding.last = first_cell_of(e, behind, cells + 1);
                if (l->out) adding.n = line->n[adding.row];
                if (begin < adding.last) add_cells(&adding, begin);
                if (!l->out) line->n[adding.row] = adding.n;
            }
    }
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

/* True if the lane of an addend follows those of another in all that is added. */
static int follows(const struct gr_addend *a, const struct gr_addend *b)
{
    return a->apart && b->apart && b->node == a->node + a->n && b->lanes == a->lanes + a->n && b->first == a->first &&
           b->kind_before == a->kind_before && (!b->first || b->end == a->end + a->n) &&
           (!b->kind_before || b->before == a->before + a->n);
}

/* Make one addend of lanes that follow each other and are runs by themselves. */
static void join_apart(struct gr_engine *e)
{
    struct gr_addend *const addend = e->mesh.addend;
    int64_t n = 0, i = 0;
    for (int row = 0; row < e->n_rows; row++) {
        const int64_t begin = n;
        for (; i < e->mesh.row_addends[row + 1]; i++) {
            if (n > begin && follows(&addend[n - 1], &addend[i]))
                addend[n - 1].n++;
            else
                addend[n++] = addend[i];
        }
        e->mesh.row_addends[row] = begin;
    }
    e->mesh.row_addends[e->n_rows] = n;
}

static int list(struct listing *l)
{
    struct gr_mesh *mesh = &l->e->mesh;
    if (list_lines(l)) return GR_ERR_MEMORY;
    list_addends(l);
    const int64_t n = place_addends(l);
    if (n > mesh->addend_capacity) {
        mesh->addend_capacity = 0;
        GR_RESIZE(mesh->addend, n + n / 2);
        mesh->addend_capacity = n + n / 2;
    }
    l->out = mesh->addend;
    list_addends(l);
    join_apart(l->e);
    return GR_OK;
}

int gr_list_addends(struct gr_engine *e, int64_t n_front, struct gr_team *team, int64_t chunks)
{
    struct listing l = {.e = e, .team = team, .chunks = chunks, .n_front = n_front};
    const int error = list(&l);
    gr_free(l.line);
    return error;
}
