/* Chains of straight segments in two dimensions: polygons, and walls along polylines. */
#pragma once

struct gr_chain {
    const double *vertex; /* (x, y) of each; anticlockwise if closed */
    int n;
    int closed;
    int revolved; /* x is the distance from an axis, and segments on the axis are no surface */
};

/* Signed distance of p, negative within a closed chain, and its gradient; of an open chain the distance. If p lies on
 * the chain, the normal points to its right, which is outwards if it is closed. */
double gr_chain_distance(const struct gr_chain *chain, const double p[2], double normal[2]);

/* The gr_edge bits of the vertices within `near` of the nearest point of the chain, or within a quarter of its segment; for
 * p next to the chain farther by as much. */
int gr_chain_edges(const struct gr_chain *chain, const double p[2], double near);
