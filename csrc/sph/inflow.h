/* Inlets (core/inlets.h) of SPH: particles enter at the upstream end of a box, in which all particles have the velocity of
 * the inlet. The box is as long as the kernel reaches, so that particles have all their neighbours when they become free at
 * its other end; the box is a reservoir that does not yield.
 *
 * The particles in the box are those that were in it when the neighbour list was made, which is whenever one enters. They
 * are given the velocity V and no acceleration instead of a, so that the box gives them -m a and their free neighbours
 * nothing else than before: the impulses of a box and on the free particles add up to 0. Points of gas have no box: a jet
 * (sph/gas.h) moves them. */
#pragma once

#include <stdint.h>

#include "core/inlets.h"

struct gr_sph;

struct gr_sph_box {
    int is_gas;                /* what enters is gas, and the box is empty */
    double lower[3], upper[3]; /* m */
    double force[3];           /* on the particles in it, in the present step, N */
    double impulse[3], work;   /* of that since the start, N s, J */
};

struct gr_sph_inflow {
    struct gr_inlets *inlets;
    struct gr_sph_box *box; /* of each inlet */
    int32_t *held, *by;     /* rows of the particles in boxes, and their inlets; as many as there are slots */
    int64_t n_held;
};

/* Add an inlet, from before the points are bound. The records are copied; `box` is for its ends and for is_gas.
 * Returned: 0, GR_ERR_MEMORY, or GR_ERR_CONFIG. */
int gr_sph_add_inlet(struct gr_sph *s, const struct gr_inlet *inlet, const struct gr_sph_box *box);
void gr_sph_free_inflow(struct gr_sph *s);

int gr_sph_make_inflow_places(struct gr_sph *s, int64_t capacity); /* memory for `capacity` rows */

/* True if there are rows for all points that may enter in a step of this length. */
int gr_sph_has_capacity(const struct gr_sph *s, double dt);

/* Let the points enter that are due. The neighbour list is to be made anew if there are any.
 * Returned: whether there are. */
int gr_sph_enter(struct gr_sph *s);

/* List the particles that are in boxes, after the rows have been sorted. */
void gr_sph_list_held(struct gr_sph *s);

/* The two halves of a step of length dt for the particles in boxes. gr_sph_hold comes between the forces and the
 * velocities. */
void gr_sph_push(struct gr_sph *s, double dt);
void gr_sph_hold(struct gr_sph *s, double dt);
