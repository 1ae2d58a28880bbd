/* The granular fluidity on a lattice: diffusion t0 g' = A^2 d^2 lap g over the cells of dense material.
 *
 * The lattice is that of the grid's cells, x fastest. A cell exchanges with the next one across a face if both are
 * dense and nothing stands between them; at a face that is open, or behind which the material is not dense, nothing
 * is exchanged (dg/dn = 0); at a rough wall g = 0 on the face itself, as if -g stood behind it:
 *     (lap g)_i = 1/dx^2 [ sum over linked neighbours (g_j - g_i) - 2 g_i (number of rough faces) ],
 * second order in dx. Source: Dunatunga & Kamrin, Modelling silo clogging with nonlocal granular rheology, eq. 2.1, 5.1
 * and 5.3. */
#ifndef GR_FLUIDITY_FLUIDITY_H
#define GR_FLUIDITY_FLUIDITY_H

#include <stdint.h>

#include "core/barrier.h"
#include "core/error.h"

/* What stands at a face, as seen from one of its cells. Two cells are linked if both say so. */
enum gr_face { GR_FACE_LINK, GR_FACE_OPEN, GR_FACE_ROUGH, GR_FACE_COUNT };

/* How a step is made (diffuse.c). */
#define GR_DIFFUSIONS(X) X(explicit) X(implicit) X(rkl2)

enum gr_diffusion {
#define GR_X(name) GR_DIFFUSION_##name,
    GR_DIFFUSIONS(GR_X)
#undef GR_X
        GR_DIFFUSION_COUNT
};

extern const char *const gr_diffusion_names[GR_DIFFUSION_COUNT];

enum { GR_RKL2_MAX_STAGES = 999 };

struct gr_fluidity_config {
    int dim;
    int64_t shape[3]; /* cells along each axis */
    int periodic[3];
    double dx;              /* m */
    double A, d, t0;        /* nonlocal amplitude, 1; grain diameter, m; time scale, s */
    double tolerance;       /* implicit: residual over the first one, in the 2-norm */
    int64_t max_iterations; /* implicit: of conjugate gradients, in a step */
    const uint8_t *face;    /* (2 dim, cells): enum gr_face at the low (2a) and high (2a + 1) side along axis a */
};

/* A link across a periodic end, from the side of one of its two cells. */
struct gr_wrap {
    int64_t to, from;
    double weight; /* 1 where both cells are dense */
};

/* Cells are worked on in chunks of a fixed size, each with its own part of every sum: threads share out whole chunks,
 * so the bits do not depend on their number. */
enum { GR_CHUNK = 512 };

struct gr_fluidity {
    int dim;
    int64_t stride[3], n_cells, n_chunks;
    int64_t n_padded; /* n_cells, in whole lanes; all arrays have zeros before and behind, so that all strides fit */
    double dx, diffusivity, tolerance; /* m, A^2 d^2/t0 in m^2/s, 1 */
    int64_t max_iterations;
    int most_faces; /* largest number of links and rough faces of a cell, were all cells dense */
    /* of the geometry */
    uint8_t *link[3];     /* 1 where nothing stands between a cell and the next along the axis */
    double *rough;        /* 2 (rough faces) */
    struct gr_wrap *wrap; /* in the order of `to` */
    int64_t *wrap_first;  /* n_chunks + 1: those of a chunk */
    /* of the state: written by the caller before a step */
    uint8_t *dense; /* 1 or 0 */
    double *g;      /* 1/s; a step moves it to another place: read the pointer again. Zero where not dense. */
    /* of a step */
    double *weight[3], *work[3]; /* 1 where a cell and the next along the axis exchange; vectors */
    double *partial[3];          /* sums over chunks */
    int64_t *partial_clamped;
    void *doubles, *bytes, *integers;
    /* result of the last call */
    int64_t iterations; /* conjugate gradients, or stages, over all of its steps */
    int64_t clamped;    /* cells whose fluidity was negative and became zero, over all of its steps */
    int error;
};

/* `steps` steps of the length dt, s. */
struct gr_diffusion_call {
    int method; /* enum gr_diffusion */
    double dt;
    int64_t steps;
};

/* A kernel of kernels.c, called by each thread t of a team. Nobody enters before all have arrived and nobody leaves
 * before all is done. Returned, the same to all: GR_OK, or GR_ERR_DIVERGED, and g is spoiled. gr_fluidity_check first. */
typedef int gr_diffuse(struct gr_fluidity *f, const struct gr_diffusion_call *call, struct gr_barrier *barrier, int t);

/* A lattice without dense cells. Returned: 0, GR_ERR_MEMORY or GR_ERR_CONFIG. */
int gr_fluidity_new(struct gr_fluidity **out, const struct gr_fluidity_config *config);
void gr_fluidity_free(struct gr_fluidity *f);

/* Steps must be shorter than this, s; infinite where every step is stable.
 * explicit: 2/lambda with the bound of Gershgorin lambda = 2 A^2 d^2/(t0 dx^2) (links + rough faces of a cell); in the
 * bulk dx^2 t0/(2 dim A^2 d^2). rkl2: (s^2 + s - 2)/4 times that, with the largest number s of stages. */
double gr_fluidity_limit(const struct gr_fluidity *f, int method);

/* Whether a call may be made. Returned: GR_OK, GR_ERR_CONFIG, or GR_ERR_LIMIT for a dt that is too long. */
int gr_fluidity_check(const struct gr_fluidity *f, const struct gr_diffusion_call *call);

/* Stages of an rkl2 step of length dt: the least odd s >= 3 with dt < (s^2 + s - 2)/4 of the explicit limit. At the
 * limit an odd number leaves 2/(s^2 + s) of the shortest wave, an even one all of it. */
int gr_fluidity_stages(const struct gr_fluidity *f, double dt);

/* Check, then run the kernel with so many threads at most. Returned: an error of the two. */
int gr_fluidity_run(struct gr_fluidity *f, gr_diffuse *kernel, const struct gr_diffusion_call *call, int threads);

#endif
