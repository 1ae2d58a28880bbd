/* How the work of a step is shared out (sharing.h). */
#include "engine/sharing.h"

#include "contact/near_bodies.h"
#include "core/memory.h"
#include "mpm/device.h"
#include "mpm/inflow.h"
#include "mpm/migrate.h"
#include "mpm/open_volume.h"
#include "mpm/sleep.h"

/* Reserve memory for the state of the points between substeps. */
static int reserve_substeps(struct gr_engine *e)
{
    const int64_t needed = e->points.capacity * GR_SUBSTEP_COUNT;
    if (!e->nonlocal.fluidity || e->config.nonlocal.substeps < 2 || needed <= e->nonlocal.substep_capacity) return GR_OK;
    gr_free(e->nonlocal.substeps);
    e->nonlocal.substeps = gr_malloc(sizeof(double) * (size_t)needed);
    e->nonlocal.substep_capacity = e->nonlocal.substeps ? needed : 0;
    return e->nonlocal.substeps ? GR_OK : GR_ERR_MEMORY;
}

static int reserve_chunks(struct gr_engine *e, int64_t n)
{
    if (n <= e->migration.chunk_capacity) return GR_OK;
    e->migration.chunk_capacity = 0;
    GR_RESIZE(e->migration.cut, n + 1);
    GR_RESIZE(e->migration.leaving, n);
    e->migration.chunk_capacity = n;
    return GR_OK;
}

/* Give chunk k space for migrants behind that for as many `points` of other chunks. */
static void lend_space(struct gr_engine *e, int k, int64_t points)
{
    e->migration.leaving[k] = (struct gr_migrants){.from = e->migration.migrant + points,
                                                   .record = e->migration.pending + points * e->points.n_components,
                                                   .id = e->migration.pending_id + points};
}

void gr_share_tiles(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    const int chunks = run->n_chunks;
    const int64_t n_tiles = e->mesh.n_tiles, divided = chunks > 1 ? n_tiles : 0; /* a device does not divide them */
    int64_t all = 0, places = 0;
    int k = 1;
    for (int64_t tile = 0; tile < divided; tile++) all += GR_LANES * e->mesh.cell[tile * GR_LANES].capacity;
    e->migration.cut[0] = 0;
    lend_space(e, 0, 0);
    for (int64_t tile = 0; tile < divided; tile++) {
        const struct gr_cell *cell = &e->mesh.cell[tile * GR_LANES];
        places += GR_LANES * cell->capacity;
        for (; k < chunks && places * chunks >= all * k; k++) {
            e->migration.cut[k] = tile + 1;
            lend_space(e, k, places);
        }
    }
    for (; k < chunks; k++) {
        e->migration.cut[k] = n_tiles;
        lend_space(e, k, places);
    }
    e->migration.cut[chunks] = n_tiles;
    e->migration.tiles_grown = 0;
}

int gr_share_out(struct gr_run *run)
{
    struct gr_engine *e = run->e;
    if (e->bodies.contacts) {
        e->bodies.contacts->listed = 0; /* the mesh may be another */
        if (gr_list_near_bodies(e) || (e->bodies.open && gr_open_volumes(e, 0))) return GR_ERR_MEMORY;
    }
    run->n_chunks = e->device ? 1 : (int)gr_chunks(run->team, GR_MAX_CHUNKS);
    if (reserve_chunks(e, run->n_chunks)) return GR_ERR_MEMORY;
    if (e->sleep && gr_sleep_begin(e)) return GR_ERR_MEMORY;
    if (reserve_substeps(e) || gr_reserve_pending(e, e->points.capacity + gr_inflow_most(e)) || gr_inflow_reserve(e))
        return GR_ERR_MEMORY;
    if (e->device && gr_device_reserve(e)) return GR_ERR_MEMORY;
    gr_share_tiles(run);
    return GR_OK;
}
