/* Rigid bodies: signed distance, motion, and what contact does to a velocity. In the plane z is 0, boxes are of infinite
 * extent along z, and cylinders stand on the plane. */
#ifndef GR_BODY_BODY_H
#define GR_BODY_BODY_H

enum { GR_MAX_BODIES = 64, GR_MAX_PARTS = 256 };

#define GR_PARTS(X) \
    X(GR_PART_BOX, box) X(GR_PART_CYLINDER, cylinder) X(GR_PART_HALF_SPACE, half_space) X(GR_PART_SAMPLED, sampled)

enum gr_part_kind {
#define GR_X(constant, name) constant,
    GR_PARTS(GR_X)
#undef GR_X
        GR_PART_COUNT
};

/* A part of a body, in coordinates of the body. */
struct gr_part {
    int kind;
    int inside;           /* 1: the solid is all that lies outside of the surface, the material is within */
    double center[3];     /* m */
    double rotation[9];   /* row-major; its columns are the axes of the part: that of a cylinder, or the outward normal of a
                           half-space, is the third */
    double size[3];       /* half edges of a box, or of that of the samples; radius and half length of a cylinder; m, may be
                           infinite */
    int shape[3];         /* samples along each axis, of one spacing */
    const double *sample; /* signed distances, m, x fastest; linear between */
};

#define GR_CONTACTS(X) X(GR_CONTACT_STICKY, sticky) X(GR_CONTACT_SEPARATING, separating) X(GR_CONTACT_BILATERAL, bilateral)

enum gr_contact {
#define GR_X(constant, name) constant,
    GR_CONTACTS(GR_X)
#undef GR_X
        GR_CONTACT_COUNT
};

/* What a body is. */
struct gr_body {
    int first_part, n_parts; /* the union of which it is */
    int contact;
    int free;        /* bit d: velocity component d follows from the forces, else from the motion */
    int rough;       /* the fluidity is 0 at its surface */
    double friction; /* Coulomb coefficient */
    double mass;     /* kg, per metre of depth in the plane; only of a body with free components */
    double bound;    /* m: no surface of it is farther from its position; may be infinite */
    double position[3], orientation[4];
    int n_motion;
    const double *motion; /* n_motion x 7: time, velocity, angular velocity; s, m/s, rad/s; linear between, held beyond */
};

/* Where a body is and what it has felt, all doubles: what a restart needs. */
struct gr_body_state {
    double x[3];               /* m */
    double orientation[4];     /* unit quaternion, scalar part first */
    double v[3], omega[3];     /* m/s, rad/s, in axes of space */
    double impulse[3];         /* of the material, since the run began, N s */
    double angular_impulse[3]; /* the same about x, which moves, N m s */
};

enum { GR_BODY_NUMBERS = sizeof(struct gr_body_state) / sizeof(double) };

/* Row-major rotation matrix of a unit quaternion: its columns are the axes of the body. */
void gr_rotation_matrix(const double orientation[4], double matrix[9]);

/* Distance of x to the surface of one part, negative in the solid, and the outward normal there: the gradient. At points
 * with several nearest ones it is that of the first axis. All in coordinates of the body. */
double gr_part_distance(const struct gr_part *part, const double x[3], double normal[3]);

/* The same of a union, min over its parts: exact without, and a bound of the depth where parts overlap. */
double gr_union_distance(const struct gr_part *parts, int n, const double x[3], double normal[3]);

/* Radius about the origin of the body that holds the surface of a part in `dim` dimensions. */
double gr_part_bound(const struct gr_part *part, int dim);

/* Velocity and angular velocity at time t, and their exact means over [begin, begin + length]. */
void gr_motion_at(const struct gr_body *body, double t, double out[6]);
void gr_motion_mean(const struct gr_body *body, double begin, double length, double out[6]);

/* Largest speed that velocity v and angular velocity omega give to a place of the body at this orientation; where it has
 * no bounds, within the distance `far` of its position. */
double gr_largest_speed(const struct gr_body *body, const struct gr_part *parts, const double orientation[4],
                        const double v[3], const double omega[3], double far);

/* Turn an orientation by the constant angular velocity omega for dt, exactly. */
void gr_turn(const double orientation[4], const double omega[3], double dt, double out[4]);

/* What contact with a surface of velocity `surface` and outward unit normal n leaves of v; u = v - surface:
 *   sticky      u' = 0
 *   separating  u' = u_t max(0, 1 - mu |u_n|/|u_t|) where u_n < 0, else u' = u
 *   bilateral   the first of these always
 * Returned: 0 if v is unchanged, 1 if the normal component alone is held (or friction slides), 2 if all is. */
int gr_contact(const struct gr_body *body, const double n[3], const double surface[3], double v[3]);

#endif
