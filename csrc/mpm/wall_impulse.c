/* Impulses of the material on the walls (wall_impulse.h). */
#include "mpm/wall_impulse.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

#include "mpm/pose.h"
#include "mpm/ranks.h"
#include "mpm/walls.h"

static int shares_are_valid(const struct gr_engine *e, int n_walls, const struct gr_wall_share *share, int n_shares,
                            const int32_t *code, int64_t n_codes)
{
    if (n_walls < 0 || n_shares < 1 || e->mesh.node_capacity || e->watch) return 0;
    for (int k = 0; k < n_shares; k++) {
        const struct gr_wall_share *s = &share[k];
        for (int d = 0; d < 3; d++)
            if (s->owner[d] < -1 || s->owner[d] >= n_walls) return 0;
        if (s->after < 0 || s->after >= n_shares || isnan(s->opens_at)) return 0;
        if (s->opens_at < INFINITY && !(share[s->after].opens_at > s->opens_at)) return 0; /* chains must end */
    }
    for (int64_t k = 0; k < n_codes; k++)
        if (code[k] < 0 || code[k] >= n_shares) return 0;
    return 1;
}

int gr_watch_walls(struct gr_engine *e, int n_walls, const struct gr_wall_share *share, int n_shares, const int32_t *code)
{
    const int64_t n_codes = gr_map_size(&e->config.node_codes);
    if (!shares_are_valid(e, n_walls, share, n_shares, code, n_codes)) return GR_ERR_CONFIG;
    struct gr_wall_watch *watch = gr_calloc(1, sizeof *watch);
    if (!watch) return GR_ERR_MEMORY;
    watch->n_walls = n_walls, watch->n_shares = n_shares;
    watch->share = gr_malloc(sizeof *share * (size_t)n_shares);
    watch->step = gr_calloc((size_t)n_walls * GR_WALL_NUMBERS + 1, sizeof(double));
    watch->total = gr_calloc((size_t)n_walls * GR_WALL_NUMBERS + 1, sizeof(double));
    watch->sum = gr_calloc((size_t)gr_wall_sums(watch), sizeof *watch->sum);
    watch->code = gr_malloc(sizeof *code * (size_t)n_codes);
    if (!watch->share || !watch->step || !watch->total || !watch->sum || !watch->code) {
        gr_watch_free(watch);
        return GR_ERR_MEMORY;
    }
    memcpy(watch->code, code, sizeof *code * (size_t)n_codes);
    memcpy(watch->share, share, sizeof *share * (size_t)n_shares);
    e->watch = watch;
    return GR_OK;
}

/* Mass at rho_c of the nodes that fill the end of the domain at which a wall stands. */
static double mass_at_end(const struct gr_engine *e, const struct gr_servo *servo)
{
    const struct gr_axis *axis = &e->axis[servo->axis];
    const int end = servo->side < 0 ? 0 : axis->n_nodes - 1;
    const double share = axis->node_integral[end] / axis->node_radius[end];
    return e->config.material[0].rho_c * e->config.dx * share * servo->area;
}

int gr_watch_servo(struct gr_engine *e, const struct gr_servo *servo)
{
    const int valid = e->watch && !e->watch->servo.height && servo->wall >= 0 && servo->wall < e->watch->n_walls &&
                      servo->axis >= 0 && servo->axis < e->config.dim && !e->config.periodic[servo->axis] &&
                      (servo->side == 1 || servo->side == -1) && (e->config.smoothed || e->config.cell_averaged) &&
                      servo->pressure > 0 && servo->area > 0 && servo->height > 0 && servo->rate > 0 && servo->limit > 0;
    if (!valid) return GR_ERR_CONFIG;
    e->watch->servo = *servo;
    e->watch->servo.full_mass = mass_at_end(e, servo);
    return GR_OK;
}

void gr_watch_free(struct gr_wall_watch *watch)
{
    if (!watch) return;
    gr_free(watch->code);
    gr_free(watch->share);
    gr_free(watch->node);
    gr_free(watch->step);
    gr_free(watch->total);
    gr_free(watch->sum);
    gr_free(watch);
}

const struct gr_wall_share *gr_wall_share_of(const struct gr_engine *e, int64_t n, int32_t at[3])
{
    const struct gr_wall_watch *watch = e->watch;
    gr_node_numbers(e, n, at);
    const struct gr_wall_share *share = &watch->share[watch->code[gr_map_place(&e->config.node_codes, at)]];
    while (e->clock.time >= share->opens_at) share = &watch->share[share->after];
    return share;
}

/* Add the impulse on a node to the sums of its walls, unless another rank does. */
static void add_node(struct gr_engine *e, int64_t n)
{
    const struct gr_wall_watch *watch = e->watch;
    struct gr_exact *const mass = watch->sum + (int64_t)watch->n_walls * GR_WALL_NUMBERS;
    int32_t at[3];
    const struct gr_wall_share *share = gr_wall_share_of(e, n, at);
    if (e->ranks && !gr_ranks_has_number(e, at)) return;
    const double *velocity = gr_wall_now(e, e->mesh.node_code[n])->velocity;
    double x[3];
    gr_node_position(e, n, x);
    for (int d = 0; d < e->config.dim; d++) {
        const double impulse = watch->node[n * e->config.dim + d];
        if (share->owner[d] < 0) continue;
        if (d == watch->servo.axis && share->owner[d] == watch->servo.wall) gr_exact_add(mass, e->nodes.mass[n]);
        if (impulse == 0) continue;
        struct gr_exact *sum = watch->sum + (int64_t)share->owner[d] * GR_WALL_NUMBERS;
        const int next = (d + 1) % 3, last = (d + 2) % 3; /* x cross the unit vector of d */
        gr_exact_add(&sum[d], impulse);
        gr_exact_add(&sum[GR_WALL_WORK], -impulse * velocity[d]);
        gr_exact_add(&sum[3 + next], x[last] * impulse);
        gr_exact_add(&sum[3 + last], -x[next] * impulse);
    }
}

int gr_sum_wall_impulses(struct gr_engine *e)
{
    struct gr_wall_watch *watch = e->watch;
    const int n_sums = gr_wall_sums(watch);
    memset(watch->sum, 0, sizeof *watch->sum * (size_t)n_sums);
    for (int64_t n = 0; n < e->mesh.n_nodes; n++)
        if (e->mesh.node_code[n]) add_node(e, n);
    const int error = e->ranks ? gr_ranks_combine(e, GR_OK, watch->sum, n_sums, NULL, 0) : GR_OK;
    for (int k = 0; k < n_sums - 1; k++) watch->step[k] = gr_exact_value(&watch->sum[k]);
    watch->servo.mass = gr_exact_value(&watch->sum[n_sums - 1]);
    return error;
}

void gr_add_wall_impulses(struct gr_engine *e)
{
    for (int64_t k = 0; k < (int64_t)e->watch->n_walls * GR_WALL_NUMBERS; k++) e->watch->total[k] += e->watch->step[k];
}
