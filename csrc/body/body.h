/* Rigid bodies: signed distance, and motion. In 2D z is 0, boxes and polygons are
 * infinite along z, the axis of a cylinder is z, and axes of capsules and of revolved chains lie in the plane of x and y. */
#pragma once

#include "body/chain.h"
#include "body/height_map.h"
#include "body/samples.h"

enum { GR_MAX_BODIES = 64, GR_MAX_PARTS = 256 };

#define GR_PARTS(X)                       \
    X(GR_PART_BOX, box)                   \
    X(GR_PART_CYLINDER, cylinder)         \
    X(GR_PART_HALF_SPACE, half_space)     \
    X(GR_PART_HEIGHT_MAP, height_map)     \
    X(GR_PART_SAMPLED, sampled)           \
    X(GR_PART_CAPSULE, capsule)           \
    X(GR_PART_TORUS, torus)               \
    X(GR_PART_POLYGON, polygon)           \
    X(GR_PART_REVOLVED, revolved)         \
    X(GR_PART_UNION, union)               \
    X(GR_PART_INTERSECTION, intersection) \
    X(GR_PART_OFFSET, offset)             \
    X(GR_PART_SHELL, shell)
#define GR_CONTACTS(X) X(GR_CONTACT_STICKY, sticky) X(GR_CONTACT_SEPARATING, separating) X(GR_CONTACT_BILATERAL, bilateral)

#define GR_X(constant, name) constant,
enum gr_part_kind { GR_PARTS(GR_X) GR_PART_COUNT };
enum gr_contact { GR_CONTACTS(GR_X) GR_CONTACT_COUNT };
#undef GR_X

/* A part of a body, in body coordinates: a shape, or an operation on the results of the parts before it, which it replaces.
 * A union or an intersection is of the last results, as many as `operands`; an offset moves the surface of the last one
 * outwards; a shell is the wall along the outer side of its surface. The union of the results that are left is the body. */
struct gr_part {
    int kind;
    int inside;         /* 1: the solid is the outside of the surface, and the material is within */
    double center[3];   /* m */
    double rotation[9]; /* row-major; its columns are the axes of the part. The third is the axis of a round shape, the
                             direction in which a polygon is extended, or the outward normal of a half-space */
    double
        size[3]; /* m, may be infinite: half edges of a box or of the box about a sampled surface; radius and half length of
                             a cylinder; radius of a capsule and half the distance of its two centers; radius of a torus
                             and of its tube; half length of a polygon; distance of an offset; half thickness of a shell.
                             The second of a polygon or revolved chain: 0 if it is closed, or half the thickness of the
                             wall along an open one */
    struct gr_chain chain; /* of a polygon, (x, y), or revolved, (r, z) */
    struct gr_samples samples;
    struct gr_height_map map;
    int operands; /* of a union or an intersection */
};

/* Edges of a surface near a point: the angle within the solid is less than a straight one, or greater. */
enum { GR_EDGE_CONVEX = 1, GR_EDGE_CONCAVE = 2 };
static inline int gr_edges_inverted(int edges) { return edges >> 1 | (edges & 1) << 1; }

/* Constant properties of a body. */
struct gr_body {
    int first_part, n_parts; /* its parts; the body is their union */
    int contact;
    int free;        /* bit d: velocity component d follows from the forces, else from the prescribed motion */
    int rough;       /* the fluidity is 0 at its surface */
    double friction; /* Coulomb coefficient */
    double mass;     /* kg, in 2D per metre of depth; needed only by a body with free components */
    int turns;       /* the angular velocity follows from the torque about its position, its centre of mass */
    double inertia[3], principal[9]; /* of a body that turns: principal moments, kg m^2, in 2D all that about z, per metre
                                        of depth; their axes in body coordinates, the columns of a rotation, row-major */
    double bound;                    /* m: radius about its position that contains its surface; may be infinite */
    double extent[3]; /* m: distance of its surface from its position along each axis of the scene at most, in all its
                         orientations; may be infinite */
    double position[3], orientation[4];
    int n_motion;
    const double *motion; /* n_motion x 7: time, velocity, angular velocity; s, m/s, rad/s; linear between rows, constant
                             beyond */
};

/* State of a body and the impulses on it; all doubles, since a restart needs all of it. */
struct gr_body_state {
    double x[3];               /* m */
    double orientation[4];     /* unit quaternion, scalar part first */
    double v[3], omega[3];     /* m/s, rad/s, in the axes of the scene */
    double impulse[3];         /* of the material on the body since the run began, N s */
    double angular_impulse[3]; /* the same about its present position x, N m s */
    double work;               /* of the contact on the material since then: impulses times nodal velocities, J */
    double driven;             /* 1: the next six replace its prescribed motion, from outside (engine/drive.h) */
    double drive[6];           /* velocity and angular velocity, m/s, rad/s */
    double load[6];            /* force and torque from outside on what moves freely, N, N m */
    double met[7];             /* time when it was last set from outside, s; impulse and angular impulse until then */
};

enum { GR_BODY_NUMBERS = sizeof(struct gr_body_state) / sizeof(double) };

/* Row-major rotation matrix of a unit quaternion; its columns are the axes of the body. */
static inline void gr_rotation_matrix(const double orientation[4], double matrix[9])
{
    const double *o = orientation, w = o[0], x = o[1], y = o[2], z = o[3];
    const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    for (int k = 0; k < 9; k++) matrix[k] = m[k];
}

/* Signed distance of x from the surface of one shape, negative in the solid, and the outward normal, its gradient. If
 * several surface points are nearest, the normal is along the first axis. All in body coordinates. */
double gr_part_distance(const struct gr_part *part, const double x[3], double normal[3]);

/* The edges of a shape that x, a point of its surface, is near to: nearer than `near` along the surface, or than a quarter
 * of the face. All of them for samples, whose edges are not known. */
int gr_part_edges(const struct gr_part *part, const double x[3], double near);

/* The shape lies within the returned distance of a box about its center with these half lengths along its axes; a round
 * shape, within the cylinder in that box. */
double gr_part_cover(const struct gr_part *part, double half[3]);

/* True if no operation takes part k of n: it is one of those whose union is the body. */
int gr_part_is_whole(const struct gr_part *parts, int n, int k);

/* True if an operation has fewer results before it than it takes. */
int gr_parts_lack_operands(const struct gr_part *parts, int n);

/* The same as gr_part_distance for all n parts of a body. Unions are the minimum: exact outside; where they overlap, a
 * bound of the depth. Intersections are the maximum: exact inside, and a bound of the distance beyond their edges. */
double gr_union_distance(const struct gr_part *parts, int n, const double x[3], double normal[3]);

/* True if x, a point of the surface of a body, may be at a convex edge of it: of its nearest shape, or one that an
 * operation makes, by the planes that touch the two surfaces which meet there. */
int gr_union_edge_near(const struct gr_part *parts, int n, const double x[3], double near);

/* Radius about the origin of the body that contains it, in `dim` dimensions. */
double gr_union_bound(const struct gr_part *parts, int n, int dim);

/* True if a rotation about an axis through the origin, given by a vector, leaves the surface as it is: all shapes are round
 * about that axis. A sphere, whose axis is any, counts as round about its own and that to its centre alone. */
int gr_union_is_round(const struct gr_part *parts, int n, const double axis[3]);

/* Prescribed velocity and angular velocity at time t, and their exact means over [begin, begin + length]. */
void gr_motion_at(const struct gr_body *body, double t, double out[6]);
void gr_motion_mean(const struct gr_body *body, double begin, double length, double out[6]);

/* Largest speed of a material point of the body with the velocity v and the angular velocity omega, at this
 * orientation. Where the body is unbounded, only points within the distance `far` of its position count. */
double gr_largest_speed(const struct gr_body *body, const struct gr_part *parts, const double orientation[4],
                        const double v[3], const double omega[3], double far);

/* Rotate an orientation by the constant angular velocity omega for dt, exactly. */
void gr_turn(const double orientation[4], const double omega[3], double dt, double out[4]);
