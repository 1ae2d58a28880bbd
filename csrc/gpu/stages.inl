/* The threads of the stages of a step (mpm/device.h): of kernels with one lane, which are the lanes of a processor. */
#include "mpm/device.h"
#include "mpm/grid.h"
#include "mpm/packing.h"
#include "mpm/smoothed_density.h"
#include "mpm/tally_cells.h"
#include "mpm/thin_bodies.h"

/* The part of its tile that a cell is. */
GR_INLINE struct gr_parts part_of(int64_t cell)
{
    const int lane = (int)(cell % GR_LANES);
    return (struct gr_parts){lane, lane + 1};
}

static void thread_p2g(const struct gr_launch *launch, int64_t i) { p2g_of_tile(launch->e, i / GR_LANES, part_of(i)); }

static void thread_p2g_dirty(const struct gr_launch *launch, int64_t i)
{
    p2g_of_tile(launch->e, launch->e->sums.dirty[i / GR_LANES], part_of(i));
}

static void thread_masses(const struct gr_launch *launch, int64_t i) { gr_grid_masses(launch->e, &GR_NAME, i, i + 1); }

static void thread_nodes(const struct gr_launch *launch, int64_t i)
{
    if (launch->e->bodies.n_thin) gr_split_nodes(launch->e, i, i + 1);
    gr_grid_nodes(launch->e, &GR_NAME, i, i + 1, launch->gravity);
}

static void thread_surroundings(const struct gr_launch *launch, int64_t i)
{
    gr_grid_surroundings(launch->e, &GR_NAME, i, i + 1);
}

static void thread_fillings(const struct gr_launch *launch, int64_t i) { fill_cells_from(launch->e, i); }

static void thread_smooth_nodes(const struct gr_launch *launch, int64_t i)
{
    gr_grid_smooth(launch->e, &GR_NAME, i, i + 1, launch->pass);
}

#ifdef GR_SINGLE
static void thread_narrow(const struct gr_launch *launch, int64_t i) { narrow_nodes(launch->e, i, i + 1); }
#define thread_cell_forces NULL
#define thread_smooth NULL
#else
static void thread_cell_forces(const struct gr_launch *launch, int64_t i)
{
    if (!gr_tile_rests(launch->e, i / GR_LANES)) forces_of_tile(launch->e, i / GR_LANES, part_of(i));
}

static void thread_smooth(const struct gr_launch *launch, int64_t i) { smooth_of_tile(launch->e, i / GR_LANES, part_of(i)); }
#define thread_narrow NULL
#endif

static int is_asleep(const struct gr_engine *e, int64_t cell) { return e->sleep && e->mesh.cell[cell].calm == GR_ASLEEP; }

/* G2P and the law for the points of a cell; those that leave it are noted. */
GR_INLINE void sweep_cell(const int dim, const int basis, const int affine, const int smoothed, const int cell_averaged,
                          struct gr_engine *e, int64_t index)
{
    const int64_t tile = index / GR_LANES;
    const struct gr_parts part = part_of(index);
    struct batch batch;
    batch.n = 0;
    e->device->leaving[index] = 0;
    if (gr_tile_rests(e, tile)) return;
    if (is_asleep(e, index)) wake_cells(dim, basis, e, index);
    if (is_asleep(e, index)) return;
    e->device->leaving[index] =
        (int32_t)(smoothed && gr_averages(e, e->clock.step)
                      ? g2p_tile(dim, basis, affine, smoothed, cell_averaged, smoothed, e, tile, part, &batch, NULL)
                      : g2p_tile(dim, basis, affine, smoothed, cell_averaged, 0, e, tile, part, &batch, NULL));
    if (batch.n) run_law(e, &batch, 0);
    if (e->points.field[GR_FIELD_shear_strain]) add_shear_strain(e, tile, part);
}

#define GR_X(d, b, a, q, u)                                                                              \
    static __attribute__((noinline)) void sweep_cell_##d##b##a##q##u(struct gr_engine *e, int64_t index) \
    {                                                                                                    \
        sweep_cell(d, b, a, q, u, e, index);                                                             \
    }
GR_VARIANTS(GR_X)
#undef GR_X

static void thread_sweep(const struct gr_launch *launch, int64_t i)
{
    if (i % GR_LANES == 0) launch->e->mesh.tile_changed[i / GR_LANES] = 0;
#define GR_X(d, b, a, q, u) \
    if (GR_IS(launch->e, d, b, a, q, u)) sweep_cell_##d##b##a##q##u(launch->e, i);
    GR_VARIANTS(GR_X)
#undef GR_X
}

/* Sums of the numbers before each of a group of at most GR_GROUP.
 * Returned: the sum of all. */
#define GR_PLACES(in, n, first, out) \
    int64_t sum = 0;                 \
    for (int64_t k = first; k < (n) && k < (first) + GR_GROUP; sum += (in)[k++]) (out)[k] = sum

static void thread_place_of_cells(const struct gr_launch *launch, int64_t i)
{
    struct gr_device *d = launch->e->device;
    GR_PLACES(d->leaving, gr_lanes_of(launch->e), i * GR_GROUP, d->place[0]);
    d->of_group[i] = sum;
}

static void thread_place_of_groups(const struct gr_launch *launch, int64_t i)
{
    struct gr_device *d = launch->e->device;
    const int64_t groups = gr_groups_of(gr_lanes_of(launch->e));
    GR_PLACES(d->of_group, groups, i * GR_GROUP, d->place[1]);
    d->of_groups[i] = sum;
}

static void thread_place_of_all(const struct gr_launch *launch, int64_t i)
{
    struct gr_device *d = launch->e->device;
    const int64_t n = gr_groups_of(gr_groups_of(gr_lanes_of(launch->e)));
    int64_t sum = i;
    for (int64_t k = 0; k < n; sum += d->of_groups[k++]) d->place[2][k] = sum;
    d->counts.leaving = sum;
}

static void add_count(int64_t *count, int64_t n)
{
    if (n) __atomic_fetch_add(count, n, __ATOMIC_RELAXED);
}

/* Pack the points that leave a cell. */
static void pack_cell(struct gr_engine *e, int64_t index)
{
    struct gr_device *d = e->device;
    const struct gr_cell *cell = &e->mesh.cell[index];
    const int64_t place = d->place[0][index] + d->place[1][index / GR_GROUP] + d->place[2][index / GR_GROUP / GR_GROUP];
    struct gr_migrants out = e->migration.leaving[0];
    out.from += place, out.record += place * e->points.n_components, out.id += place;
    gr_clear_migrants(&out);
    for (int32_t k = 0; k < cell->count; k++) {
        const int64_t slot = gr_slot(cell, k);
        if (d->leaves[slot]) out.from[out.count++] = (struct gr_migrant){.cell = index, .slot = slot};
        d->leaves[slot] = 0;
    }
    gr_pack_migrants(e, &out, 0);
    add_count(&d->counts.invalid, out.invalid);
    add_count(&d->counts.outside, out.outside);
    add_count(&d->counts.homeless, out.homeless);
}

static void thread_pack(const struct gr_launch *launch, int64_t i)
{
    if (launch->e->device->leaving[i]) pack_cell(launch->e, i);
    if (!is_asleep(launch->e, i)) thread_p2g(launch, i);
}

/* Add a migrant to those that come to its new cell, in any order. */
static void thread_post(const struct gr_launch *launch, int64_t i)
{
    struct gr_device *d = launch->e->device;
    const int64_t to = launch->e->migration.leaving[0].from[i].to;
    if (to >= 0) d->next[i] = __atomic_exchange_n(&d->arrivals[to], i + 1, __ATOMIC_RELAXED);
}

/* The first migrant after number k of those that come to a cell; -1 if there is none. */
static int64_t next_arrival(const struct gr_device *d, int64_t index, int64_t k)
{
    int64_t first = -1;
    for (int64_t at = d->arrivals[index] - 1; at >= 0; at = d->next[at] - 1)
        if (at > k && (first < 0 || at < first)) first = at;
    return first;
}

/* Put the migrants that come to a cell into it, in their order, and make its sums again. */
static void thread_arrive(const struct gr_launch *launch, int64_t i)
{
    struct gr_engine *e = launch->e;
    struct gr_device *d = e->device;
    const struct gr_migrants *list = &e->migration.leaving[0];
    if (!d->arrivals[i]) return;
    for (int64_t k = next_arrival(d, i, -1); k >= 0; k = next_arrival(d, i, k)) {
        if (gr_put_point(e, &e->mesh.cell[i], list->record + k * e->points.n_components, list->id[k])) continue;
        list->from[k].slot = GR_NOT_PUT;
        add_count(&d->counts.full, 1);
    }
    d->arrivals[i] = 0;
    thread_p2g(launch, i);
}

static void thread_tally(const struct gr_launch *launch, int64_t i)
{
    if (i % GR_SIZE(GR_LANES, 1) == 0) gr_tally_cells(launch->e, i); /* the emulated device does those of a tile */
}

static void thread_fastest(const struct gr_launch *launch, int64_t i)
{
    const struct gr_engine *e = launch->e;
    double largest = 0;
    for (int64_t c = i * GR_GROUP; c < e->mesh.n_cells && c < (i + 1) * GR_GROUP; c++)
        for (int32_t k = 0; k < e->mesh.cell[c].count; k++) {
            const double square = gr_speed_squared(e, gr_slot(&e->mesh.cell[c], k));
            if (square > largest) largest = square;
        }
    e->device->fastest[i] = largest;
}

static void thread_occupied(const struct gr_launch *launch, int64_t i)
{
    const struct gr_mesh *mesh = &launch->e->mesh;
    int64_t occupied = 0;
    for (int64_t c = i * GR_GROUP; c < mesh->n_cells && c < (i + 1) * GR_GROUP; c++) occupied += mesh->cell[c].count > 0;
    launch->e->device->of_group[i] = occupied;
}

#include "gpu/fluidity.inl"
#include "gpu/sleep.inl"

/* ---- The passes of a regrouping ---- */

/* The items of a thread: one, or a chunk. */
static void share_of_thread(const struct gr_launch *launch, int64_t i, int64_t *first, int64_t *last)
{
    if (launch->chunks == launch->items)
        *first = i, *last = i + 1;
    else
        gr_share(launch->items, i, launch->chunks, first, last);
}

#define GR_X(pass, item)                                                 \
    static void thread_##pass(const struct gr_launch *launch, int64_t i) \
    {                                                                    \
        int64_t first, last;                                             \
        share_of_thread(launch, i, &first, &last);                       \
        gr_pass_##pass(launch->e, launch->work, first, last, i);         \
    }
GR_REGROUP_PASSES(GR_X)
#undef GR_X

static gr_thread *const threads[GR_STAGE_COUNT] = {
#define GR_X(stage, unit) thread_##stage,
    GR_DEVICE_STAGES(GR_X)
#undef GR_X
};
