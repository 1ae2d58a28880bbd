/* Neighbour search: the points are sorted by cell, and the neighbours of each are listed as blocks of rows. */
#include <math.h>
#include <string.h>

#include "core/index.h"
#include "core/memory.h"
#include "core/simd.h"
#include "sph/gas.h"
#include "sph/inflow.h"
#include "sph/sph.h"

static const double far_away = 1e30; /* position of spare rows: finite, and beyond the reach of the kernel */

/* Cell of a position. Positions outside belong to the last cell on their side, NaN to the first. */
static int32_t cell_at(const struct gr_sph *s, const double *x)
{
    int64_t cell = 0;
    for (int d = s->config.dim - 1; d >= 0; d--) {
        const double u = (x[d] - s->config.lower[d]) * s->per_cell[d];
        cell = cell * s->shape[d] + gr_index(u, 0, s->shape[d] - 1);
    }
    return (int32_t)cell;
}

/* Whether a wall particle is so far outside that it changes nothing in the domain: particles within its reach have a
 * density by the Shepard filter, a sum over densities that are sums themselves: three times the reach in all. */
static int is_far_outside(const struct gr_sph *s, const double *x)
{
    const double far = 3 * s->reach;
    for (int d = 0; d < s->config.dim; d++)
        if (x[d] < s->config.lower[d] - far || x[d] > s->config.upper[d] + far) return 1;
    return 0;
}

static void place_of(const struct gr_sph *s, int field, int64_t row, double *x)
{
    double *const *rows = gr_sph_rows(s, field);
    for (int d = 0; d < s->config.dim; d++) x[d] = rows[d][row];
}

/* Wrap the position of a point into the period.
 * Returned: whether it is in the domain. */
static int wrap(const struct gr_sph *s, int64_t row)
{
    const struct gr_sph_config *c = &s->config;
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x);
    int inside = 1;
    for (int d = 0; d < c->dim; d++) {
        double *at = &x[d][row];
        const double length = c->upper[d] - c->lower[d];
        if (c->periodic[d]) {
            *at -= length * floor((*at - c->lower[d]) / length);
            if (*at >= c->upper[d]) *at = c->lower[d]; /* rounded up to the end */
        } else {
            inside &= *at >= c->lower[d] && *at <= c->upper[d];
        }
    }
    return inside;
}

static void make_spare(struct gr_sph *s, int64_t first, int64_t last)
{
    for (int f = 0; f < GR_SPH_FIELD_COUNT; f++) {
        double *const *rows = gr_sph_rows(s, f);
        const int place = f == GR_SPH_FIELD_x || f == GR_SPH_FIELD_anchor;
        for (int k = 0; k < gr_sph_components(s, f); k++)
            for (int64_t a = first; a < last; a++) rows[k][a] = place ? far_away : 0.0;
    }
    for (int64_t a = first; a < last; a++) s->id[a] = -1, s->lump[a] = s->volume[a] = 0.0;
    for (int k = 0; k < 6; k++)
        for (int64_t a = first; a < last; a++) s->pull[k][a] = 0.0;
}

/* Bring the rows from `first` on into the order s->order, in all fields that persist from step to step. */
static void permute(struct gr_sph *s, int64_t first, int64_t n)
{
    const int is_wall = first == s->wall_first;
    double *const *end = gr_sph_rows(s, is_wall ? GR_SPH_FIELD_a : GR_SPH_FIELD_normal);
    int in_order = 1;
    for (int64_t k = 0; k < n; k++) in_order &= s->order[k] == first + k;
    if (in_order) return;
    for (double *const *row = s->row; row < end; row++) {
        for (int64_t k = 0; k < n; k++) s->sorted[k] = (*row)[s->order[k]];
        memcpy(*row + first, s->sorted, sizeof(double) * (size_t)n);
    }
    for (int64_t k = 0; k < n; k++) s->sorted_id[k] = s->id[s->order[k]];
    memcpy(s->id + first, s->sorted_id, sizeof(int64_t) * (size_t)n);
}

/* Sort the n rows from `first` on by the cells of their anchors, stably; rows with cell -1 are removed, those with cell
 * n_cells come last, and no search finds them.
 * Returned: the number of rows left. */
static int64_t sort_rows(struct gr_sph *s, int64_t first, int64_t n, int32_t *start)
{
    const int64_t bins = s->n_cells + 1; /* with the last one, which no search finds */
    memset(start, 0, sizeof(int32_t) * (size_t)(bins + 1));
    for (int64_t a = first; a < first + n; a++)
        if (s->cell[a] >= 0) start[s->cell[a] + 1]++;
    for (int64_t c = 0; c < bins; c++) start[c + 1] += start[c];
    const int64_t n_left = start[bins];
    for (int64_t a = first; a < first + n; a++)
        if (s->cell[a] >= 0) s->order[start[s->cell[a]]++] = (int32_t)a;
    /* each entry is now the end of its cell, which is the start of the next */
    memmove(start + 1, start, sizeof(int32_t) * (size_t)bins);
    start[0] = 0;
    for (int64_t c = 0; c <= bins; c++) start[c] += (int32_t)first;
    permute(s, first, n_left);
    return n_left;
}

void gr_sph_sort(struct gr_sph *s, int fresh)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *anchor = gr_sph_rows(s, GR_SPH_FIELD_anchor);
    const double *mass = gr_sph_rows(s, GR_SPH_FIELD_mass)[0];
    const int64_t n[3] = {s->n_particles, s->n_walls, s->n_gas}, first[3] = {0, s->wall_first, s->gas_first};
    for (int kind = 0; kind < 3; kind++)
        for (int64_t a = first[kind]; a < first[kind] + n[kind]; a++) {
            const int in_domain = !fresh || wrap(s, a), stays = kind == 1 ? !gr_sph_is_gone(s, a) : in_domain;
            double at[3];
            if (fresh)
                for (int d = 0; d < s->config.dim; d++) anchor[d][a] = x[d][a];
            place_of(s, GR_SPH_FIELD_anchor, a, at);
            s->cell[a] = stays ? cell_at(s, at) : -1;
            /* a long wall outside would fill the cells at the end of the grid: a time that grows as its square */
            if (kind == 1 && stays && is_far_outside(s, at)) s->cell[a] = (int32_t)s->n_cells;
            if (stays || kind == 1) continue;
            if (kind == 0)
                s->dropped++, s->dropped_mass += mass[a];
            else
                s->gas_dropped++;
        }
    s->n_particles = sort_rows(s, 0, n[0], s->start[0]);
    s->n_walls = sort_rows(s, s->wall_first, n[1], s->start[1]);
    if (s->gas) s->n_gas = sort_rows(s, s->gas_first, n[2], s->start[2]);
    make_spare(s, s->n_particles, s->wall_first);
    make_spare(s, s->wall_first + s->n_walls, s->gas_first);
    make_spare(s, s->gas_first + s->n_gas, s->capacity);
    if (s->inflow) gr_sph_list_held(s);
}

struct search {
    double at[3];
    int cell[3];
    int64_t covered[GR_SPH_SHIFTS]; /* per shift: rows below this one are already in a block */
    struct gr_block *out;
    int64_t n; /* number of blocks; those beyond the stride are only counted */
};

/* Bit mask of the GR_LANES rows from b on that are within reach. */
GR_INLINE unsigned near_rows(int dim, const struct gr_sph *s, const struct search *q, double *const *anchor, int64_t b,
                             int shift)
{
    unsigned near = 0;
    for (int lane = 0; lane < GR_LANES; lane += GR_W) {
        vd r2 = v_zero();
        for (int d = 0; d < dim; d++) {
            const vd r = v_load(anchor[d] + b + lane) + v_set(s->shift[shift][d]) - v_set(q->at[d]);
            r2 = r2 + r * r;
        }
        near |= m_bits(v_ge(v_set(s->reach * s->reach), r2)) << lane;
    }
    return near;
}

/* List the rows within reach in a run of cells, as images moved by a shift. */
GR_INLINE void search_rows(int dim, const struct gr_sph *s, struct search *q, int64_t b, int64_t last, int shift)
{
    double *const *anchor = gr_sph_rows(s, GR_SPH_FIELD_anchor);
    while (b < last) {
        unsigned near = near_rows(dim, s, q, anchor, b, shift);
        if (last - b < GR_LANES) near &= (1u << (last - b)) - 1u;
        if (!near) {
            b += GR_LANES;
            continue;
        }
        b += __builtin_ctz(near);
        if (q->n < s->stride) q->out[q->n] = (struct gr_block){(int32_t)b, shift};
        q->n++;
        b = q->covered[shift] = b + s->lanes;
    }
}

static void search_run(const struct gr_sph *s, struct search *q, int kind, int64_t first_cell, int64_t last_cell, int shift)
{
    const int64_t first = s->start[kind][first_cell], last = s->start[kind][last_cell + 1];
    const int64_t b = first < q->covered[shift] ? q->covered[shift] : first;
    if (s->config.dim == 2)
        search_rows(2, s, q, b, last, shift);
    else
        search_rows(3, s, q, b, last, shift);
}

/* Search all runs in a row of cells along x; `before` is the first cell of the row, `shift` the number of the shift
 * along the other axes. */
static void search_row(const struct gr_sph *s, struct search *q, int kind, int64_t before, int shift)
{
    const int n = s->shape[0], low = q->cell[0] - GR_SPH_CELLS_IN_REACH, high = q->cell[0] + GR_SPH_CELLS_IN_REACH;
    if (s->config.periodic[0] && low < 0) search_run(s, q, kind, before + low + n, before + n - 1, shift);
    search_run(s, q, kind, before + (low < 0 ? 0 : low), before + (high >= n ? n - 1 : high), shift + 1);
    if (s->config.periodic[0] && high >= n) search_run(s, q, kind, before, before + high - n, shift + 2);
}

/* Wrap the index of a cell along an axis, which may be beyond an end.
 * Returned: the index, or -1 beyond an end that is not periodic. *shift grows by `unit` for each period, counted from
 * -1. */
static int wrapped(const struct gr_sph *s, int d, int cell, int unit, int *shift)
{
    const int n = s->shape[d], image = cell < 0 ? 0 : cell >= n ? 2 : 1;
    *shift += image * unit;
    if (image == 1) return cell;
    return s->config.periodic[d] ? cell + (1 - image) * n : -1;
}

static void search_all(const struct gr_sph *s, struct search *q, int kind)
{
    const int dim = s->config.dim, out = dim == 3 ? GR_SPH_CELLS_IN_REACH : 0;
    memset(q->covered, 0, sizeof q->covered);
    for (int k = -out; k <= out; k++) {
        int shift_z = 0;
        const int z = dim == 3 ? wrapped(s, 2, q->cell[2] + k, 9, &shift_z) : 0;
        if (z < 0) continue;
        for (int j = -GR_SPH_CELLS_IN_REACH; j <= GR_SPH_CELLS_IN_REACH; j++) {
            int shift = dim == 3 ? shift_z : 9;
            const int y = wrapped(s, 1, q->cell[1] + j, 3, &shift);
            if (y >= 0) search_row(s, q, kind, ((int64_t)z * s->shape[1] + y) * s->shape[0], shift);
        }
    }
}

/* Whether a row is of a wall particle far outside. Its only neighbours are itself and what follows it, so that its sums are
 * finite: it may follow one that is a neighbour of others, in the same block, with the weight 0. */
static int is_unsearched(const struct gr_sph *s, int64_t a)
{
    return a >= s->start[1][s->n_cells] && a < s->wall_first + s->n_walls;
}

int64_t gr_sph_list_blocks(struct gr_sph *s, int64_t first, int64_t last)
{
    int64_t most = 0;
    for (int64_t a = first; a < last; a++) {
        struct search q = {.out = s->block + a * s->stride};
        s->begin[a] = s->middle[a] = a * s->stride;
        if (is_unsearched(s, a)) {
            if (s->stride) q.out[0] = (struct gr_block){(int32_t)a, GR_SPH_SHIFTS / 2}; /* not shifted */
            s->end[a] = s->begin[a] + 1;
            if (!most) most = 1;
            if (s->gas) s->gas->end[a] = s->end[a];
            continue;
        }
        place_of(s, GR_SPH_FIELD_anchor, a, q.at);
        int64_t cell = cell_at(s, q.at);
        for (int d = 0; d < s->config.dim; d++) q.cell[d] = (int)(cell % s->shape[d]), cell /= s->shape[d];
        search_all(s, &q, 0);
        s->middle[a] += q.n;
        if (s->n_walls) search_all(s, &q, 1);
        s->end[a] = s->begin[a] + q.n;
        if (s->n_gas) search_all(s, &q, 2);
        if (s->gas) s->gas->end[a] = s->begin[a] + q.n;
        if (q.n > most) most = q.n;
    }
    return most;
}

int gr_sph_widen(struct gr_sph *s, int64_t needed)
{
    const int64_t stride = needed + needed / 4 + 4; /* it grows a few times at the start of a run only */
    struct gr_block *wider = gr_malloc(sizeof *wider * (size_t)(stride * s->capacity));
    if (!wider) return GR_ERR_MEMORY;
    gr_free(s->block);
    s->block = wider, s->stride = stride;
    return GR_OK;
}
