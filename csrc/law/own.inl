/* A user-defined law: a function that is called with arrays of points, after the elastic predictor (law.h, gr_own_update).
 * Without a function it is elastic. */
#ifdef GR_LIST_LAWS
GR_LAW(own)
#else
#include "law/trial.h"

enum { OWN_BLOCKS = GR_SIZE(256 / GR_W, 1) }; /* blocks per call, as many as a batch has */

/* The points of some blocks in arrays of their own, component by component. */
struct gr_own_points {
    _Alignas(64) double gradient[9 * OWN_BLOCKS * GR_W], stress[6 * OWN_BLOCKS * GR_W], c[OWN_BLOCKS * GR_W];
    _Alignas(64) double rate[OWN_BLOCKS * GR_W], history[GR_HISTORY_COUNT * OWN_BLOCKS * GR_W];
};

/* Component c of the gradient with three rows of three, which functions are given in 2D, too. */
GR_INLINE vd of_space(const int dim, const vd L[9], const int c)
{
    const int i = c / 3, j = c % 3;
    if (dim == 3) return L[c];
    if (i < 2 && j < 2) return L[2 * i + j];
    return i == j ? L[4] : v_zero();
}

/* Copy the data of n blocks from block `first` on, with their trial stress. */
GR_INLINE void gr_gather_own(const int dim, const struct gr_law_call *call, int64_t first, int64_t n,
                             struct gr_own_points *to)
{
    const vd K = v_set(call->parameter[0]), G = v_set(call->parameter[1]);
    for (int64_t k = 0; k < n; k++) {
        const int64_t at = call->slot[first + k], place = k * GR_W, stride = n * GR_W;
        const struct gr_stress t = gr_trial(dim, call, first + k, K, G);
        vd L[9];
        gr_load_gradient(dim, gr_gradient_of(dim, call, first + k), L);
        for (int c = 0; c < 9; c++) v_store(to->gradient + c * stride + place, of_space(dim, L, c));
        for (int c = 0; c < GR_STRESSES(dim); c++) v_store(to->stress + c * stride + place, t.s[c]);
        for (int c = 0; call->history && c < GR_HISTORY_COUNT; c++)
            v_store(to->history + c * stride + place, v_load(call->history + c * call->capacity + at));
        v_store(to->c + place, v_load(call->log_density + at));
        v_store(to->rate + place, v_zero());
    }
}

/* Let the function update n blocks from block `first` on. If it is not done it is called once more, with the same data: an
 * exception of Python that has nothing to do with it, such as a time limit, then changes no result. */
GR_INLINE void gr_update_own(const int dim, const struct gr_law_call *call, int64_t first, int64_t n,
                             struct gr_own_points *points)
{
    for (int tries = 0; tries < 2; tries++) {
        int64_t done = 0;
        gr_gather_own(dim, call, first, n, points);
        if (!call->function) return;
        call->function(n * GR_W, dim, call->dt, call->own_parameter, points->gradient, points->c, points->stress,
                       points->rate, points->history, &done);
        if (done == 1) return;
        __atomic_store_n(tries ? &call->own_calls->failed : &call->own_calls->repeated, 1, __ATOMIC_RELAXED);
    }
}

GR_INLINE void law_own(const int dim, const struct gr_law_call *call)
{
    struct gr_own_points points;
    for (int64_t first = 0; first < call->n_blocks; first += OWN_BLOCKS) {
        const int64_t left = call->n_blocks - first, n = left < OWN_BLOCKS ? left : OWN_BLOCKS, stride = n * GR_W;
        gr_update_own(dim, call, first, n, &points);
        for (int64_t k = 0; k < n; k++) {
            const int64_t at = call->slot[first + k], place = k * GR_W;
            for (int c = 0; c < GR_STRESSES(dim); c++)
                v_store(call->stress[c] + at, v_load(points.stress + c * stride + place));
            for (int c = 0; call->history && c < GR_HISTORY_COUNT; c++)
                v_store(call->history + c * call->capacity + at, v_load(points.history + c * stride + place));
            if (call->shear_rate) v_store(call->shear_rate + at, v_load(points.rate + place));
            if (call->g) v_store(call->g + at, v_zero());
        }
    }
}

GR_DESCRIBE_LAW(own, .doc = "a user-defined law, called with the trial stress", .parameter = {GR_ELASTIC_PARAMETERS})
#endif
