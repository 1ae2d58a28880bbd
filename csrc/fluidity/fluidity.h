/* The granular fluidity on a lattice: diffusion t0 g' = A^2 d^2 lap g over the cells of dense material.
 *
 * The lattice is that of the grid's cells, x fastest. A cell exchanges with the next one across a face if both are
 * dense and nothing stands between them; at a face that is open, or behind which the material is not dense, nothing
 * is exchanged (dg/dn = 0); at a rough wall g = 0 on the face itself, as if -g stood behind it:
 *     (lap g)_i = 1/dx^2 [ sum over linked neighbours (g_j - g_i) - 2 g_i (number of rough faces) ],
 * second order in dx. Source: Dunatunga & Kamrin, Modelling silo clogging with nonlocal granular rheology, eq. 2.1, 5.1
 * and 5.3. With the isotropic stencil cells across edges and corners take part, see links.c.
 *
 * About a thin a cell may have two values, one for each side: a copy of it at the back has a place of its own. Which of
 * them exchange is told before each step (gr_cut_of).
 *
 * Only the cells that are asked for have places, in pages of GR_PAGE cells that follow each other in the box: memory and
 * time grow with the material, and the cells beside those of a page are still whole vectors. */
#ifndef GR_FLUIDITY_FLUIDITY_H
#define GR_FLUIDITY_FLUIDITY_H

#include <stdint.h>

#include "core/barrier.h"
#include "core/error.h"
#include "core/table.h"

/* What stands at a face, as seen from one of its cells. Two cells are linked if both say so. */
#define GR_FACES(X) X(GR_FACE_LINK, link) X(GR_FACE_OPEN, open) X(GR_FACE_ROUGH, rough)

enum gr_face {
#define GR_X(constant, name) constant,
    GR_FACES(GR_X)
#undef GR_X
        GR_FACE_COUNT
};

/* How a step is made (diffuse.inl). */
#define GR_DIFFUSIONS(X) X(explicit) X(implicit) X(rkl2)

enum gr_diffusion {
#define GR_X(name) GR_DIFFUSION_##name,
    GR_DIFFUSIONS(GR_X)
#undef GR_X
        GR_DIFFUSION_COUNT
};

extern const char *const gr_diffusion_names[GR_DIFFUSION_COUNT];

/* Which cells take part in the Laplacian. */
#define GR_STENCILS(X) X(faces) X(isotropic)

enum gr_stencil {
#define GR_X(name) GR_STENCIL_##name,
    GR_STENCILS(GR_X)
#undef GR_X
        GR_STENCIL_COUNT
};

extern const char *const gr_stencil_names[GR_STENCIL_COUNT];

enum { GR_RKL2_MAX_STAGES = 999 };

struct gr_fluidity_config {
    int dim, stencil;
    int64_t shape[3];           /* cells along each axis */
    int periodic[3], two_sided; /* two_sided: cells may have copies at the back */
    double dx;                  /* m */
    double A, d, t0;            /* nonlocal amplitude, 1; grain diameter, m; time scale, s */
    double tolerance;           /* implicit: residual over the first one, in the 2-norm */
    int64_t max_iterations;     /* implicit: of conjugate gradients, in a step */
    const uint8_t *face;        /* (2 dim, cells): enum gr_face at the low (2a) and high (2a + 1) side along axis a */
};

/* The same, agreed upon by both cells; nothing lies behind the ends of the box. */
enum gr_side { GR_SIDE_CLOSED, GR_SIDE_LINKED, GR_SIDE_ROUGH };

/* Where a cell is to the bodies: bits. A copy that is apart has the value of one side of a thin, that which is BEHIND or
 * not; any other cell has one value, and that bit tells on which side its middle is; its copy at the back is hidden.
 * BEYOND: the middle of a copy that is apart lies on the other side of a rough thin. */
enum gr_inside { GR_INSIDE_BODY = 1, GR_BEHIND = 2, GR_SEPARATED = 4, GR_HIDDEN = 8, GR_BEYOND_ROUGH = 16 };

/* What the bodies make of a face between two cells. With a copy that is apart only its own side exchanges, so that each has
 * one partner behind a face at most; g = 0 where a rough body ends, or stands nearest to a rough thin. */
static inline int gr_cut_of(uint8_t a, uint8_t b)
{
    if (((a | b) & GR_HIDDEN) || (((a | b) & GR_SEPARATED) && ((a ^ b) & GR_BEHIND))) return GR_SIDE_CLOSED;
    return (a ^ b) & (GR_INSIDE_BODY | GR_BEYOND_ROUGH) ? GR_SIDE_ROUGH : GR_SIDE_LINKED;
}

/* A link to a place that is not beside: across a periodic end, or to the other copy. From the side of one of its cells. */
struct gr_wrap {
    int32_t to, from;
    int32_t link;
    double weight; /* as gr_fluidity.weight */
};

enum {
    GR_PAGE = 8,         /* cells in a page: the widest vector */
    GR_CHUNK_PAGES = 64, /* A chunk has the pages of 512 cells of the box that follow each other. Each has its own part of
                            every sum: threads share out whole chunks, so the bits depend neither on their number nor on
                            which cells without material have places. */
    GR_MOST_LINKS = 13   /* of a cell, each to two sides */
};

struct gr_fluidity {
    int dim, stencil, n_links, periodic[3], two_sided;
    int64_t shape[3], stride[3], n_cells, box_pages; /* of the box */
    double dx, diffusivity, tolerance;               /* m, A^2 d^2/t0 in m^2/s, 1 */
    int64_t max_iterations;
    double stiffest; /* no eigenvalue of L is larger than twice this */
    /* of the box */
    int8_t offset[GR_MOST_LINKS][3]; /* of the cell at the high side of a link; link a < dim goes along axis a */
    struct gr_table side;            /* per cell of the box, 2 bits for each face: enum gr_side ^ GR_SIDE_LINKED */
    struct gr_table page_of;         /* per page of the box, and again at the back: its number here + 1, 0 for none */
    /* of the pages: cell k of page q has the place GR_PAGE q + k. Arrays of places have a page of zeros at both ends. */
    int64_t n_pages, page_capacity, n_chunks, n_wraps, wrap_capacity;
    int64_t *page;                    /* number in the box, ascending; + box_pages at the back */
    int64_t *chunk_first;             /* n_chunks + 1: pages of a chunk */
    int32_t *near;                    /* per page, link and side (low, high): place of the cell beside the first one */
    uint8_t *link[2 * GR_MOST_LINKS]; /* faces: 1 where a cell is linked to the one at that place */
    int32_t *beside;                  /* isotropic: per place, link and side, the place of that cell; -1 without a way */
    int32_t *other;                   /* isotropic: per place, that of the other copy, -1 without one */
    double *rough_walls;              /* 2 (rough faces) */
    struct gr_wrap *wrap;             /* in the order of `to` */
    int64_t *wrap_first;              /* n_chunks + 1: those of a chunk */
    /* of the state: written by the caller before a step */
    uint8_t *dense;  /* 1 or 0 */
    int has_inside;  /* inside is in use: */
    uint8_t *inside; /* enum gr_inside */
    double *g;       /* 1/s; a step moves it to another place: read the pointer again. Zero where not dense. */
    double *gain;    /* free for the caller */
    /* of a step */
    double *weight[2 * GR_MOST_LINKS], *rough, *work[3]; /* of the links to both sides; of g itself; vectors */
    double *partial[3];                                  /* sums over chunks */
    int64_t *partial_clamped;
    void *doubles, *bytes;
    int64_t *integers;
    int32_t *places;
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

/* A lattice without places. Returned: 0, GR_ERR_MEMORY or GR_ERR_CONFIG. */
int gr_fluidity_new(struct gr_fluidity **out, const struct gr_fluidity_config *config);
void gr_fluidity_free(struct gr_fluidity *f);

/* What stands at face k of a cell of the box. */
static inline int gr_fluidity_side(const struct gr_fluidity *f, int64_t cell, int k)
{
    return (gr_table_get(&f->side, cell) >> 2 * k & 3) ^ GR_SIDE_LINKED;
}

/* pages.c: take over the faces of the box, a part of gr_fluidity_new. Returned: 0 or GR_ERR_MEMORY. */
int gr_fluidity_describe(struct gr_fluidity *f, const uint8_t *face);

/* pages.c: give places to n cells of the box, ascending, and to none else but the rest of their pages; or to all of the
 * box, in its order, where `cells` is NULL. A cell whose `sides` is -1 is a copy at the back of the one before it; NULL
 * without any. No cell is dense. Returned: 0, or GR_ERR_MEMORY and there are no places. */
int gr_fluidity_cover(struct gr_fluidity *f, const int64_t *cells, const int8_t *sides, int64_t n);

/* Place of a cell of the box that has one, or of its copy at the back. */
static inline int64_t gr_fluidity_place(const struct gr_fluidity *f, int64_t cell, int back)
{
    const int64_t page = cell / GR_PAGE + (back ? f->box_pages : 0);
    return ((int64_t)gr_table_get(&f->page_of, page) - 1) * GR_PAGE + cell % GR_PAGE;
}

/* links.c: weights of all links of a chunk with the isotropic stencil, from which cells are dense. */
void gr_fluidity_weigh(struct gr_fluidity *f, int64_t chunk);

/* Steps must be shorter than this, s; infinite where every step is stable.
 * explicit: 2/lambda, lambda no less than the largest eigenvalue of A^2 d^2/(t0 dx^2) L. With faces that is the bound of
 * Gershgorin, lambda = 2 A^2 d^2/(t0 dx^2) (links + rough faces of a cell), in the bulk dt < dx^2 t0/(2 dim A^2 d^2); for
 * the isotropic stencil see links.c. rkl2: (s^2 + s - 2)/4 times that, with the largest number s of stages. */
double gr_fluidity_limit(const struct gr_fluidity *f, int method);

/* Whether a call may be made. Returned: GR_OK, GR_ERR_CONFIG, or GR_ERR_LIMIT for a dt that is too long. */
int gr_fluidity_check(const struct gr_fluidity *f, const struct gr_diffusion_call *call);

/* Stages of an rkl2 step of length dt: the least odd s >= 3 with dt < (s^2 + s - 2)/4 of the explicit limit. At the
 * limit an odd number leaves 2/(s^2 + s) of the shortest wave, an even one all of it. */
int gr_fluidity_stages(const struct gr_fluidity *f, double dt);

/* Check, then run the kernel with so many threads at most. Returned: an error of the two. */
int gr_fluidity_run(struct gr_fluidity *f, gr_diffuse *kernel, const struct gr_diffusion_call *call, int threads);

#endif
