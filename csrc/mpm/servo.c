/* A wall that keeps a pressure (servo.h). */
#include "mpm/servo.h"

#include <math.h>

#include "mpm/wall_impulse.h"

double gr_servo_strain(const struct gr_engine *e)
{
    const struct gr_wall_watch *watch = e->watch;
    if (!watch || !watch->servo.height) return 0;
    return watch->total[watch->servo.wall * GR_WALL_NUMBERS + GR_WALL_DISPLACEMENT] / watch->servo.height;
}

void gr_move_servo(struct gr_engine *e)
{
    struct gr_servo *servo = &e->watch->servo;
    double *step = e->watch->step + servo->wall * GR_WALL_NUMBERS;
    const double waiting = e->watch->total[servo->wall * GR_WALL_NUMBERS + GR_WALL_EXCESS];
    const int touched = servo->mass >= 0.5 * servo->full_mass,
              averages = !e->config.smoothed || gr_averages(e, e->clock.step);
    const double now = touched ? servo->side * step[servo->axis] / servo->area - servo->pressure * e->clock.dt : 0;
    const double excess = touched ? waiting + now : 0, before = e->servo_strain;
    e->servo_shift = 0;
    step[GR_WALL_EXCESS] = averages ? -waiting : now;
    if (!averages) return;
    const double strain = fmax(-servo->limit, fmin(before + servo->rate * excess, servo->limit));
    const double time = (e->config.smoothed ? e->config.averaging_interval : 1) * e->clock.dt;
    e->servo_shift = before - strain;
    step[GR_WALL_DISPLACEMENT] = servo->height * (strain - before);
    step[GR_WALL_WORK] -= (servo->pressure + excess / time) * servo->area * step[GR_WALL_DISPLACEMENT];
}
