/* SPH walls that move and are removed at given times, and particles that would pass through them. */
#include <math.h>

#include "sph/sph.h"

/* Index of the wall of a wall point; always valid, whatever the buffer contains. */
static int wall_of(const struct gr_sph *s, int64_t row)
{
    const double k = gr_sph_rows(s, GR_SPH_FIELD_wall)[0][row];
    return k > 0 && k < s->config.n_walls ? (int)k : 0;
}

static int moves(const struct gr_sph_wall *wall, double time) { return time >= wall->from; }

int gr_sph_is_gone(const struct gr_sph *s, int64_t row)
{
    return s->config.n_walls && s->time >= s->config.wall[wall_of(s, row)].until;
}

int gr_sph_begin_walls(struct gr_sph *s)
{
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    const double before = s->time - s->dt;
    int changes = 0, goes = 0;
    for (int k = 0; k < s->config.n_walls; k++) {
        const struct gr_sph_wall *wall = &s->config.wall[k];
        const double way = s->time - wall->from;
        s->wall_dt[k] = way > s->dt ? s->dt : way > 0 ? way : 0.0;
        changes |= moves(wall, s->time) && !moves(wall, before);
        goes |= s->time >= wall->until && before < wall->until;
    }
    for (int64_t a = s->wall_first; changes && a < s->wall_first + s->n_walls; a++) {
        const struct gr_sph_wall *wall = &s->config.wall[wall_of(s, a)];
        for (int d = 0; d < s->config.dim; d++) v[d][a] = moves(wall, s->time) ? wall->v[d] : 0.0;
    }
    return goes;
}

void gr_sph_move_walls(struct gr_sph *s, int64_t first, int64_t last)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    for (int64_t a = first; a < last; a++) {
        const double dt = s->config.n_walls ? s->wall_dt[wall_of(s, a)] : s->dt;
        for (int d = 0; d < s->config.dim; d++) x[d][a] += dt * v[d][a];
    }
}

/* Present ends of a wall along an axis. */
static void ends_of(const struct gr_sph *s, const struct gr_sph_wall *wall, int d, double *low, double *high)
{
    const double time = s->time < wall->from ? 0.0 : s->time - wall->from;
    *low = wall->lower[d] + time * wall->v[d], *high = wall->upper[d] + time * wall->v[d];
}

/* Friction of a contact in which the wall removes the normal velocity `lost` from a particle: at most mu times that is
 * removed from the tangential velocity. A particle that lies on a wall alone has no pressure and would otherwise slide
 * for ever. */
static void rub(const struct gr_sph *s, const double *wall_v, int axis, double lost, int64_t a)
{
    double *const *v = gr_sph_rows(s, GR_SPH_FIELD_v), along2 = 0;
    const double mu = s->config.parameter[s->config.wall_friction ? GR_SPH_P_mu_wall : GR_SPH_P_mu_l];
    for (int d = 0; d < s->config.dim; d++)
        if (d != axis) along2 += (v[d][a] - wall_v[d]) * (v[d][a] - wall_v[d]);
    const double along = sqrt(along2), share = along > mu * lost ? 1.0 - mu * lost / along : 0.0;
    for (int d = 0; d < s->config.dim; d++)
        if (d != axis) v[d][a] = wall_v[d] + share * (v[d][a] - wall_v[d]);
}

/* Put a particle that entered a wall in this step, coming from `before`, back onto the face through which it came, at
 * rest relative to that face. */
static int stop(const struct gr_sph *s, const struct gr_sph_wall *wall, double wall_dt, const double *before, int64_t a)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v);
    const int dim = s->config.dim;
    int axis = -1;
    double face = 0.0;
    for (int k = 0; k < dim; k++) {
        const int d = (wall->axis + k) % dim; /* the axis across the wall first */
        double low, high;
        ends_of(s, wall, d, &low, &high);
        if (!(x[d][a] > low && x[d][a] < high)) return 0;
        const double from = before[d] + wall_dt * wall->v[d]; /* relative to the moving wall */
        if (axis < 0 && !(from > low && from < high)) axis = d, face = from <= low ? low : high;
    }
    if (axis < 0) return 0; /* it was inside already */
    const double still[3] = {0}, *wall_v = wall_dt > 0 ? wall->v : still;
    x[axis][a] = face;
    rub(s, wall_v, axis, fabs(v[axis][a] - wall_v[axis]), a);
    v[axis][a] = wall_v[axis];
    return 1;
}

int64_t gr_sph_stop(struct gr_sph *s, int64_t first, int64_t last)
{
    double *const *x = gr_sph_rows(s, GR_SPH_FIELD_x), *const *v = gr_sph_rows(s, GR_SPH_FIELD_v), before[3];
    int64_t stopped = 0;
    for (int64_t a = first; a < last; a++) {
        if (s->middle[a] == s->end[a]) continue; /* far from all walls */
        for (int d = 0; d < s->config.dim; d++) before[d] = x[d][a] - s->dt * v[d][a];
        for (int k = 0; k < s->config.n_walls; k++)
            if (s->time < s->config.wall[k].until) stopped += stop(s, &s->config.wall[k], s->wall_dt[k], before, a);
    }
    return stopped;
}
