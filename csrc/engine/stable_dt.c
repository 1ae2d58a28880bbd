/* The longest stable time step (stable_dt.h). */
#include "engine/stable_dt.h"

#include <math.h>

#include "contact/moving.h"
#include "core/inlets.h"
#include "mpm/device.h"
#include "mpm/numbers.h"
#include "mpm/ranks.h"
#include "mpm/sleep.h"

/* The largest speed of the points, squared, by chunks of cells. */
struct fastest {
    const struct gr_engine *e;
    int64_t chunks;
    double square[GR_MAX_CHUNKS];
};

static void find_fastest(void *context, int64_t chunk, int t)
{
    struct fastest *fastest = context;
    const struct gr_engine *e = fastest->e;
    int64_t first, last;
    double largest = 0;
    (void)t;
    gr_share(e->mesh.n_cells, chunk, fastest->chunks, &first, &last);
    for (int64_t c = first; c < last; c++) {
        const struct gr_cell *cell = &e->mesh.cell[c];
        for (int32_t k = 0; cell->calm != GR_ASLEEP && k < cell->count; k++) { /* asleep: v = 0 */
            const double square = gr_speed_squared(e, gr_slot(cell, k));
            if (square > largest) largest = square;
        }
    }
    fastest->square[chunk] = largest;
}

static double dt_at(const struct gr_engine *e, double speed)
{
    return gr_damped_dt(e->config.cfl * e->config.dx / (e->config.wave_speed + speed), e->config.largest.damping_time);
}

/* Square of the largest speed of the points. */
static double fastest_of_points(const struct gr_engine *e, struct gr_team *team)
{
    struct fastest fastest = {.e = e, .chunks = gr_chunks(team, e->mesh.n_cells)};
    double square = 0;
    gr_team_run(team, find_fastest, &fastest, fastest.chunks);
    for (int64_t c = 0; c < fastest.chunks; c++) square = fmax(square, fastest.square[c]);
    return square;
}

double gr_stable_dt(const struct gr_engine *e, struct gr_team *team)
{
    double square = e->device && e->device->makes_steps ? gr_device_fastest(e) : fastest_of_points(e, team);
    if (e->ranks) gr_ranks_find_largest(e, &square);
    double speed = fmax(sqrt(square), fmax(gr_bodies_speed(e), gr_inlets_speed(e->inflow)));
    for (int k = 0; k < e->config.n_walls; k++) {
        const double *wall = e->config.walls[k].velocity;
        speed = fmax(speed, sqrt(wall[0] * wall[0] + wall[1] * wall[1] + wall[2] * wall[2]));
    }
    return dt_at(e, speed);
}

double gr_stable_dt_of_bodies(const struct gr_engine *e) { return dt_at(e, gr_bodies_speed(e)); }

void gr_use_dt(struct gr_engine *e, double dt)
{
    if (dt == e->clock.dt) return;
    e->clock.dt = dt;
    e->clock.time_anchor = e->clock.time;
    e->clock.step_anchor = e->clock.step;
    if (e->sleep) e->sleep->all_nodes = 1;
}
