/* The granular fluidity on a grid: the diffusion t0 g' = A^2 d^2 lap g over the cells of dense material.
 *
 * The fluidity grid consists of the cells of the MPM grid, x fastest. A cell exchanges with the next one across a face if
 * both are dense and nothing separates them. At an open face, or where the next cell is not dense, nothing is exchanged
 * (dg/dn = 0). At a rough face (a no-slip wall), g = 0 on the face itself, as if the value behind it were -g:
 *
 *     (lap g)_i = 1/dx^2 [ sum over linked neighbours (g_j - g_i) - 2 g_i (number of rough faces) ],
 *
 * which is of second order in dx. In an axisymmetric plane, whose first axis is the radius, a link or rough face at an
 * offset o along it counts (r + o dx/2)/r times, the area of the face over that of the middle of the cell. Source: Dunatunga & Kamrin, Modelling silo clogging with nonlocal granular rheology,
 * eq. 2.1, 5.1 and 5.3. With the isotropic stencil the cells across edges and corners take part, see links.c.
 *
 * At a rough body g = 0 on its surface, wherever this lies between the centres of cells, see border.c. Before each step the
 * caller gives the distances of the centres from the surfaces.
 *
 * Near a thin body a cell may have two values, one for each side: a copy of the cell represents the back. Before each
 * step the caller states which of them exchange (gr_cut_of).
 *
 * Only requested cells have storage. It is divided into pages of GR_PAGE consecutive cells of the box, so that memory
 * and time grow with the material and the neighbours of a page can still be loaded as whole vectors. The index of a
 * cell in these arrays is called its place. */
#pragma once

#include <stdint.h>

#include "core/error.h"
#include "core/exact.h"
#include "core/table.h"
#include "core/team.h"

/* Kind of a face, as seen from one of its cells. Two cells are linked if both sides are of kind `link`. */
#define GR_FACES(X) X(GR_FACE_LINK, link) X(GR_FACE_OPEN, open) X(GR_FACE_ROUGH, rough)

#define GR_X(constant, name) constant,
enum gr_face { GR_FACES(GR_X) GR_FACE_COUNT };
#undef GR_X

/* Time-stepping methods (diffuse.c). */
#define GR_DIFFUSIONS(X) X(explicit) X(implicit) X(rkl2)

#define GR_X(name) GR_DIFFUSION_##name,
enum gr_diffusion { GR_DIFFUSIONS(GR_X) GR_DIFFUSION_COUNT };
#undef GR_X

extern const char *const gr_diffusion_names[GR_DIFFUSION_COUNT];

/* Stencils of the Laplacian: cells across faces only, or also across edges and corners. */
#define GR_STENCILS(X) X(faces) X(isotropic)

#define GR_X(name) GR_STENCIL_##name,
enum gr_stencil { GR_STENCILS(GR_X) GR_STENCIL_COUNT };
#undef GR_X

extern const char *const gr_stencil_names[GR_STENCIL_COUNT];

enum { GR_RKL2_MAX_STAGES = 999 };

struct gr_fluidity_config {
    int dim, stencil;
    int64_t shape[3];           /* cells along each axis */
    int periodic[3], two_sided; /* two_sided: cells may have a copy for the back of a thin body */
    int rough_bodies;           /* 1 if there may be border cells */
    double dx;                  /* m */
    int axisymmetric;           /* 1: the first axis is the radius */
    double first_radius;        /* where it begins, in cells */
    double A, d, t0;            /* nonlocal amplitude, 1; grain diameter, m; time scale, s */
    double tolerance;           /* implicit: final residual over the first one, in the 2-norm */
    int64_t max_iterations;     /* implicit: of the conjugate gradients, per step */
    const uint8_t *face;        /* (2 dim, cells): enum gr_face of the low (2a) and high (2a + 1) side along axis a */
};

/* Kind of a face after both cells were taken into account; a face at an end that is not periodic is never linked. */
enum gr_side { GR_SIDE_CLOSED, GR_SIDE_LINKED, GR_SIDE_ROUGH };

/* Position of a cell relative to the bodies, as bits. A *separated* copy holds the fluidity of one side of a thin body,
 * the back if BEHIND is set. Any other cell has one value: BEHIND then tells on which side its centre is, and its copy
 * for the back is HIDDEN. BORDER: at a rough surface, see border.c; LINKED_TO_BORDER: linked to such a cell. */
enum gr_inside { GR_BORDER = 1, GR_BEHIND = 2, GR_SEPARATED = 4, GR_HIDDEN = 8, GR_LINKED_TO_BORDER = 16 };

/* Kind of the face between two cells, from their gr_inside bits: rough to a border cell. A separated copy exchanges only
 * with its own side, so that every cell has at most one partner behind a face. */
static inline int gr_cut_of(uint8_t a, uint8_t b)
{
    if (((a | b) & GR_HIDDEN) || (((a | b) & GR_SEPARATED) && ((a ^ b) & GR_BEHIND))) return GR_SIDE_CLOSED;
    return (a | b) & GR_BORDER ? GR_SIDE_ROUGH : GR_SIDE_LINKED;
}

/* A link that is not at the usual distance in the arrays: across a periodic end, or to the other copy. It is listed for
 * both of its cells. */
struct gr_wrap {
    int32_t to, from;
    int32_t link;
    double weight; /* as gr_fluidity.weight */
};

enum {
    GR_PAGE = 8,         /* cells in a page: the width of the widest vector */
    GR_CHUNK_PAGES = 64, /* A chunk is the pages of 512 consecutive cells of the box. Every sum has one part per chunk,
                            and threads share whole chunks. The bits therefore depend neither on the number of threads nor
                            on which cells without material have places. */
    GR_MOST_LINKS = 13   /* of a cell; each has a low and a high side */
};

/* The pages in storage: cell k of page q has the place GR_PAGE q + k. All arrays over places have a page of zeros at both
 * ends. */
struct gr_pages {
    int64_t n, capacity, n_chunks, n_wraps, wrap_capacity;
    int64_t *number;                  /* of a page in the box, ascending; + box_pages for copies */
    int64_t *chunk_first;             /* n_chunks + 1: first page of each chunk */
    int32_t *near;                    /* per page, link and side (low, high): place of the neighbour of its first cell */
    uint8_t *link[2 * GR_MOST_LINKS]; /* stencil of faces: 1 where a cell is linked to the one at that place */
    int32_t *neighbour;               /* isotropic: per place, link and side, the place of that neighbour; -1 where it
                                         cannot be reached */
    int32_t *other;                   /* isotropic: per place, the place of the other copy, -1 without one */
    double *rough_walls;              /* 2 (number of rough faces) */
    struct gr_wrap *wrap;             /* in ascending order of `to` */
    int64_t *wrap_first;              /* n_chunks + 1: first of each chunk */
};

/* Work space of a step. */
struct gr_diffusion_space {
    double *weight[2 * GR_MOST_LINKS], *rough; /* of the links to both sides; coefficient of g itself */
    double *radius;                            /* of a cell, in cells; NULL unless axisymmetric */
    double *vector[3];
    double *partial[2]; /* parts of the sums of a pass, per chunk */
    int64_t *partial_clamped;
    void *doubles, *bytes; /* memory of all arrays over places */
    int64_t *integers;
    int32_t *places;
};

/* Other ranks that share the grid (mpm/ranks.h): each has whole chunks. Their cells next to own ones have places here, too. */
struct gr_fluidity_ranks {
    void *context;
    /* Set the values of the cells of others that are next to own ones, and `dense` unless it is NULL. Returned: 0, or not 0
     * if a rank has not answered; the same holds for the next. */
    int (*exchange)(void *context, double *values, uint8_t *dense);
    int (*sum)(void *context, struct gr_exact *sum); /* over all ranks */
    uint8_t *foreign;                                /* per chunk: 1 if it is one of another rank */
};

/* The search for the minimum by conjugate gradients: what one pass finds and the next one uses. */
struct gr_descent {
    double rr, enough; /* squared norm of the residual, and the one at which the search ends */
    double scale;      /* alpha of the next `descend`, or beta of the next `turn` */
    int64_t made;      /* iterations of this step */
    int ended, failed; /* passes of the search change nothing once it has ended */
};

struct gr_fluidity {
    int dim, stencil, n_links, periodic[3], two_sided, rough_bodies, axisymmetric;
    double first_radius;
    int64_t shape[3], stride[3], n_cells, box_pages; /* of the box; box_pages: whole chunks if there may be copies */
    double dx, diffusivity, tolerance;               /* m, A^2 d^2/t0 in m^2/s, 1 */
    int64_t max_iterations;
    double stiffest;                 /* half an upper bound of the eigenvalues of L */
    int8_t offset[GR_MOST_LINKS][3]; /* offset of the cell at the high side of a link; link a < dim goes along axis a */
    struct gr_table side;            /* per cell of the box, 2 bits for each face: enum gr_side ^ GR_SIDE_LINKED */
    struct gr_table page_of;         /* per page of the box, then per page of copies: its number here + 1, 0 for none */
    struct gr_pages pages;
    /* state, written by the caller before a step */
    uint8_t *dense;  /* 1 or 0 */
    int has_inside;  /* 1 if `inside` is used */
    uint8_t *inside; /* enum gr_inside */
    /* with rough bodies only (border.c): distance of the centre from the surface, of a border cell the distance of its
     * points, in cells, >= 0; and per link and side (phi_i - phi_j)/phi_i to a border cell, else 0 */
    double *distance, *drop[2 * GR_MOST_LINKS];
    double *g;           /* 1/s; zero where not dense. A step swaps this pointer: read it again afterwards. */
    double *gain, *mean; /* for use by the caller */
    struct gr_diffusion_space space;
    struct gr_descent descent;
    /* result of the last call */
    int64_t iterations; /* iterations of the conjugate gradients, or stages, over all steps */
    int64_t clamped;    /* cells whose negative fluidity was set to zero, over all steps */
    int error;
    struct gr_fluidity_ranks *ranks; /* NULL without any */
};

/* A call: `steps` steps of length dt, s. */
struct gr_diffusion_call {
    int method; /* enum gr_diffusion */
    double dt;
    int64_t steps;
};

/* Passes over all cells, of which steps consist (passes.inl). */
#define GR_DIFFUSION_PASSES(X) \
    X(connect) X(explicit) X(first_residual) X(multiply) X(descend) X(turn) X(first_stage) X(later_stage) X(clamp)

#define GR_X(name) GR_PASS_##name,
enum gr_diffusion_pass { GR_DIFFUSION_PASSES(GR_X) GR_PASS_COUNT };
#undef GR_X

/* Coefficients of stage j of rkl2, with dt M = -k L:
 *
 *   Y_1 = Y_0 + mu~_1 dt M Y_0,
 *   Y_j = mu_j Y_j-1 + nu_j Y_j-2 + (1 - mu_j - nu_j) Y_0 + mu~_j dt M Y_j-1 + gamma~_j dt M Y_0. */
struct gr_stage {
    double mu, nu, step, back; /* mu_j, nu_j, mu~_j k, -gamma~_j k */
};

/* What a pass is given. */
struct gr_diffusion_work {
    struct gr_fluidity *f;
    enum gr_diffusion_pass which;
    double k;            /* dt A^2 d^2/(t0 dx^2) */
    double *g, *work[3]; /* the arrays of f, swapped */
    double *in, *out;    /* rkl2: Y_j-1, and Y_j-2, which Y_j replaces; else `out` is the result */
    struct gr_stage stage;
};

/* The passes for grids whose cells have 2, 3, 4 or 13 links: work on a chunk of cells, whose context is a gr_diffusion_work. */
struct gr_passes {
    gr_chunk_work *of[4][GR_PASS_COUNT];
};

/* A device, which makes passes in place of a team. */
struct gr_diffusion_device {
    void *context;
    void (*pass)(void *context,
                 const struct gr_diffusion_work *); /* with the end of the pass (gr_end_pass); may go on then */
    int (*wait)(void *context);                     /* Returned: not 0 if the device has failed */
};

/* diffuse.c: make the steps of a call, as the leader of a team. Call gr_fluidity_check first. `device` is NULL if processors
 * make all passes.
 * Returned: GR_OK, or GR_ERR_DIVERGED, after which g is unusable. */
int gr_fluidity_diffuse(struct gr_fluidity *f, const struct gr_passes *passes, const struct gr_diffusion_call *call,
                        struct gr_team *team, const struct gr_diffusion_device *device);

/* Make a fluidity grid without places.
 * Returned: 0, GR_ERR_MEMORY or GR_ERR_CONFIG. */
int gr_fluidity_new(struct gr_fluidity **out, const struct gr_fluidity_config *config);
void gr_fluidity_free(struct gr_fluidity *f);

/* Area at an offset of o/2 cells along the radius over that of the middle of a cell of the box; 1 in a plane. */
static inline double gr_fluidity_ring(const struct gr_fluidity *f, int64_t cell, int o)
{
    return f->axisymmetric ? 1 + 0.5 * o / (f->first_radius + (double)(cell % f->shape[0]) + 0.5) : 1;
}

/* The cell of the box that has a place. */
static inline int64_t gr_fluidity_cell(const struct gr_fluidity *f, int64_t i)
{
    return f->pages.number[i / GR_PAGE] % f->box_pages * GR_PAGE + i % GR_PAGE;
}

/* enum gr_side of face k of a cell of the box. */
static inline int gr_fluidity_side(const struct gr_fluidity *f, int64_t cell, int k)
{
    return (gr_table_get(&f->side, cell) >> 2 * k & 3) ^ GR_SIDE_LINKED;
}

/* pages.c: store the faces of the box, a part of gr_fluidity_new.
 * Returned: 0 or GR_ERR_MEMORY. */
int gr_fluidity_describe(struct gr_fluidity *f, const uint8_t *face);

/* pages.c: give places to n cells of the box, in ascending order, and to the rest of their pages, but to no others. If
 * `cells` is NULL, all cells of the box have places, in its order. A cell whose `sides` is -1 is the copy, for the
 * back, of the cell before it; `sides` is NULL without copies. Afterwards no cell is dense.
 * Returned: 0; or GR_ERR_MEMORY, and no cell has a place. */
int gr_fluidity_cover(struct gr_fluidity *f, const int64_t *cells, const int8_t *sides, int64_t n);

/* Place of a cell of the box, or of its copy for the back; it must have one. */
static inline int64_t gr_fluidity_place(const struct gr_fluidity *f, int64_t cell, int back)
{
    const int64_t page = cell / GR_PAGE + (back ? f->box_pages : 0);
    return ((int64_t)gr_table_get(&f->page_of, page) - 1) * GR_PAGE + cell % GR_PAGE;
}

/* pages.c: the same, -1 if it has none or `cell` is -1. */
int64_t gr_fluidity_find(const struct gr_fluidity *f, int64_t cell, int back);

/* pages.c: the cell of the box at an offset of at most one along each axis, if all sequences of steps along the axes that
 * lead there are linked, else -1. */
int64_t gr_fluidity_reach(const struct gr_fluidity *f, int64_t cell, const int offset[3]);

/* border.c: give the distance of the centre of a cell from the surfaces of rough bodies, negative in a body, m, and the
 * distance of the middle of its points, which is used for a border cell. All its links then lead to no border cell. */
void gr_fluidity_set_distance(struct gr_fluidity *f, int64_t i, double phi, double of_points);

/* border.c: then give the distance phi of the centre of the neighbour at link and side k = 2 link + side, which must be
 * linked. */
void gr_fluidity_set_link(struct gr_fluidity *f, int64_t i, int k, double phi);

/* border.c: set g in the border cells of a chunk from that around them. */
void gr_fluidity_extrapolate(const struct gr_fluidity *f, int64_t chunk, double *g);

/* (phi_i - phi_j)/phi_i if link and side k of a cell lead to a border cell, else 0. */
static inline double gr_fluidity_drop(const struct gr_fluidity *f, int64_t i, int k)
{
    return f->inside[i] & GR_LINKED_TO_BORDER ? f->drop[k][i] : 0;
}

/* links.c: half an upper bound of the eigenvalues of L for the isotropic stencil. */
double gr_fluidity_stiffest(const struct gr_fluidity *f);

/* links.c: set the weights of all links of a cell for the isotropic stencil, from the dense cells; and those of the listed
 * links of a chunk. */
void gr_fluidity_weigh(struct gr_fluidity *f, int64_t i);
void gr_fluidity_weigh_wraps(struct gr_fluidity *f, int64_t chunk);

/* Stability limit: steps must be shorter than this, s; infinite if all steps are stable.
 *
 * explicit: 2/lambda, with lambda an upper bound of the eigenvalues of A^2 d^2/(t0 dx^2) L. For the stencil of faces it
 * is Gershgorin's, lambda = 2 A^2 d^2/(t0 dx^2) (links + rough faces of a cell), which gives dt < dx^2 t0/(2 dim A^2 d^2)
 * in the bulk, and no less at rough bodies. For the isotropic stencil see links.c. rkl2: (s^2 + s - 2)/4 times that, with
 * the largest number s of stages. */
double gr_fluidity_limit(const struct gr_fluidity *f, int method);

/* Check whether a call is possible.
 * Returned: GR_OK, GR_ERR_CONFIG, or GR_ERR_LIMIT if dt is too long. */
int gr_fluidity_check(const struct gr_fluidity *f, const struct gr_diffusion_call *call);

/* Number of stages of an rkl2 step of length dt: the smallest odd s >= 3 with dt < (s^2 + s - 2)/4 times the explicit
 * limit. At the limit an odd number damps the shortest wave to 2/(s^2 + s) of it, an even one not at all. */
int gr_fluidity_stages(const struct gr_fluidity *f, double dt);

/* Check a call, then make its steps with at most `threads` threads.
 * Returned: 0, or the error of either. */
int gr_fluidity_run(struct gr_fluidity *f, const struct gr_passes *passes, const struct gr_diffusion_call *call,
                    int threads);
