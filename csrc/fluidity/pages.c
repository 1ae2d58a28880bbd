/* Storage of the fluidity grid: which cells have places, and the links between them. */
#include "core/memory.h"
#include "fluidity/fluidity.h"

/* Number of possible pages: of the box, and of copies for the back. */
static int64_t all_pages(const struct gr_fluidity *f) { return f->two_sided ? 2 * f->box_pages : f->box_pages; }

int64_t gr_fluidity_find(const struct gr_fluidity *f, int64_t cell, int back)
{
    if (cell < 0 || (back && !f->two_sided)) return -1;
    return gr_table_get(&f->page_of, cell / GR_PAGE + (back ? f->box_pages : 0)) ? gr_fluidity_place(f, cell, back) : -1;
}

/* Step by `side` (-1 or 1) along an axis from the cell at `at`, through periodic ends.
 * Returned: 0, or -1 at an end. */
static int walk(const struct gr_fluidity *f, int axis, int side, int64_t *cell, int64_t at[3])
{
    const int64_t n = f->shape[axis], next = at[axis] + side;
    if ((next < 0 || next >= n) && !f->periodic[axis]) return -1;
    const int64_t to = (next + n) % n;
    *cell += (to - at[axis]) * f->stride[axis];
    at[axis] = to;
    return 0;
}

/* gr_fluidity_reach for the cell at `at`. */
static int64_t reach(const struct gr_fluidity *f, int64_t cell, const int64_t at[3], const int offset[3])
{
    int64_t target = -1;
    for (int a = 0; a < f->dim; a++) {
        if (!offset[a]) continue;
        int64_t next = cell, there[3] = {at[0], at[1], at[2]};
        int rest[3] = {offset[0], offset[1], offset[2]};
        rest[a] = 0;
        if (gr_fluidity_side(f, cell, 2 * a + (offset[a] > 0)) != GR_SIDE_LINKED) return -1;
        if (walk(f, a, offset[a], &next, there)) return -1;
        target = rest[0] || rest[1] || rest[2] ? reach(f, next, there, rest) : next;
        if (target < 0) return -1;
    }
    return target;
}

static void find_coordinates(const struct gr_fluidity *f, int64_t cell, int64_t at[3])
{
    at[0] = at[1] = at[2] = 0;
    for (int a = 0; a < f->dim; a++) {
        at[a] = cell % f->shape[a];
        cell /= f->shape[a];
    }
}

int64_t gr_fluidity_reach(const struct gr_fluidity *f, int64_t cell, const int offset[3])
{
    int64_t at[3];
    find_coordinates(f, cell, at);
    return reach(f, cell, at, offset);
}

/* Store the faces of the box. Two cells are linked if both say so.
 * Returned: the largest sum of links and rough faces of a cell if all cells were dense; or -1 without memory. */
static double read_faces(struct gr_fluidity *f, const uint8_t *face)
{
    double most = 0;
    for (int64_t i = 0; i < f->n_cells; i++) {
        int64_t at[3];
        int sides = 0;
        double count = 0;
        find_coordinates(f, i, at);
        for (int k = 0; k < 2 * f->dim; k++) {
            int64_t j = i, there[3] = {at[0], at[1], at[2]};
            const int kind = face[k * f->n_cells + i], ends = walk(f, k / 2, k % 2 ? 1 : -1, &j, there);
            int side = kind == GR_FACE_ROUGH ? GR_SIDE_ROUGH : GR_SIDE_CLOSED;
            if (kind == GR_FACE_LINK && !ends && face[(k ^ 1) * f->n_cells + j] == GR_FACE_LINK) side = GR_SIDE_LINKED;
            const int counts = side == GR_SIDE_ROUGH || (side == GR_SIDE_LINKED && j != i);
            count += counts * gr_fluidity_ring(f, i, k / 2 ? 0 : k % 2 ? 1 : -1);
            sides |= (side ^ GR_SIDE_LINKED) << 2 * k;
        }
        if (gr_table_set(&f->side, i, sides)) return -1;
        if (count > most) most = count;
    }
    return most;
}

/* List the links: first those along the axes; then, for the isotropic stencil, those across edges and corners. Of two
 * opposite offsets only one is listed. */
static void list_links(struct gr_fluidity *f)
{
    for (int a = 0; a < f->dim; a++) f->offset[f->n_links++][a] = 1;
    for (int n = 2; f->stencil == GR_STENCIL_isotropic && n <= f->dim; n++)
        for (int k = 0; k < 27; k++) {
            const int o[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
            const int axes = !!o[0] + !!o[1] + !!o[2], first = o[0] ? o[0] : o[1];
            if (axes != n || first < 0 || (f->dim == 2 && o[2])) continue;
            for (int a = 0; a < 3; a++) f->offset[f->n_links][a] = (int8_t)o[a];
            f->n_links++;
        }
}

int gr_fluidity_describe(struct gr_fluidity *f, const uint8_t *face)
{
    if (gr_table_new(&f->side, f->n_cells) || gr_table_new(&f->page_of, all_pages(f))) return GR_ERR_MEMORY;
    list_links(f);
    const double most = read_faces(f, face);
    if (most < 0) return GR_ERR_MEMORY;
    f->stiffest = most;
    if (f->stencil == GR_STENCIL_isotropic) f->stiffest = gr_fluidity_stiffest(f);
    return GR_OK;
}

static void forget(struct gr_fluidity *f)
{
    gr_table_clear(&f->page_of);
    f->pages.n = f->pages.n_chunks = f->pages.n_wraps = 0;
}

/* Set up zeroed arrays for n pages. */
static int reserve(struct gr_fluidity *f, int64_t n)
{
    const int sides = 2 * f->n_links, isotropic = f->stencil == GR_STENCIL_isotropic;
    const int n_always = 8 + sides, n_vectors = n_always + (f->rough_bodies ? 1 + sides : 0) + (f->axisymmetric ? 1 : 0),
              n_maps = isotropic ? 2 : 2 + sides;
    if (n > f->pages.capacity || !f->space.doubles) {
        gr_free(f->space.doubles), gr_free(f->space.bytes), gr_free(f->space.integers), gr_free(f->space.places);
        f->pages.capacity = n + n / 2 + 2; /* with the pages of zeros at both ends */
        const size_t capacity = (size_t)f->pages.capacity;
        f->space.doubles = gr_malloc((capacity * (size_t)(n_vectors * GR_PAGE + 2)) * sizeof(double));
        f->space.bytes = gr_malloc(capacity * (size_t)n_maps * GR_PAGE);
        f->space.integers = gr_malloc(capacity * 4 * sizeof(int64_t));
        f->space.places =
            gr_malloc(capacity * (size_t)(isotropic ? sides + (sides + 1) * GR_PAGE : sides) * sizeof(int32_t));
        if (!f->space.doubles || !f->space.bytes || !f->space.integers || !f->space.places) {
            f->pages.capacity = -1;
            return GR_ERR_MEMORY;
        }
        f->pages.capacity -= 2;
    }
    const int64_t pages = f->pages.capacity + 2, length = pages * GR_PAGE;
    double *at = f->space.doubles, **const vectors[] = {&f->g,
                                                        &f->gain,
                                                        &f->mean,
                                                        &f->space.rough,
                                                        &f->pages.rough_walls,
                                                        &f->space.vector[0],
                                                        &f->space.vector[1],
                                                        &f->space.vector[2]};
    memset(f->space.doubles, 0, (size_t)(pages * (n_vectors * GR_PAGE + 2)) * sizeof(double));
    memset(f->space.bytes, 0, (size_t)(length * n_maps));
    for (int k = 0; k < 8; k++, at += length) *vectors[k] = at + GR_PAGE;
    for (int k = 0; k < sides; k++, at += length) f->space.weight[k] = at + GR_PAGE;
    if (f->rough_bodies) {
        f->distance = at + GR_PAGE, at += length;
        for (int k = 0; k < sides; k++, at += length) f->drop[k] = at + GR_PAGE;
    }
    if (f->axisymmetric) f->space.radius = at + GR_PAGE, at += length;
    for (int k = 0; k < 2; k++, at += pages) f->space.partial[k] = at;
    f->dense = (uint8_t *)f->space.bytes + GR_PAGE;
    f->inside = f->dense + length;
    for (int k = 0; k < sides; k++) f->pages.link[k] = isotropic ? 0 : f->inside + (k + 1) * length;
    f->pages.number = f->space.integers, f->pages.chunk_first = f->pages.number + pages;
    f->pages.wrap_first = f->pages.chunk_first + pages, f->space.partial_clamped = f->pages.wrap_first + pages;
    f->pages.near = f->space.places, f->pages.neighbour = isotropic ? f->pages.near + sides * pages : 0;
    f->pages.other = isotropic ? f->pages.neighbour + sides * length : 0;
    return GR_OK;
}

static int add_page(struct gr_fluidity *f, int64_t page)
{
    if (!f->pages.n || f->pages.number[f->pages.n - 1] / GR_CHUNK_PAGES != page / GR_CHUNK_PAGES)
        f->pages.chunk_first[f->pages.n_chunks++] = f->pages.n;
    f->pages.number[f->pages.n++] = page;
    return gr_table_set(&f->page_of, page, (int32_t)f->pages.n);
}

/* Find the places of the neighbours of the cells of a page. They are consecutive even where they belong to two pages.
 * Neighbours without places may get any place, as their weight is zero. */
static void find_near(struct gr_fluidity *f, int64_t q)
{
    for (int k = 0; k < 2 * f->n_links; k++) {
        int64_t cell = f->pages.number[q] * GR_PAGE, near = q * GR_PAGE;
        for (int a = 0; a < f->dim; a++) cell += (k % 2 ? 1 : -1) * f->offset[k / 2][a] * f->stride[a];
        const int64_t page = cell < 0 ? -((-cell + GR_PAGE - 1) / GR_PAGE) : cell / GR_PAGE, shift = cell - page * GR_PAGE;
        const int64_t last = all_pages(f) - 1;
        const int32_t low = page >= 0 && page <= last ? gr_table_get(&f->page_of, page) : 0;
        const int32_t high = shift && page >= -1 && page < last ? gr_table_get(&f->page_of, page + 1) : 0;
        if (low)
            near = ((int64_t)low - 1) * GR_PAGE + shift;
        else if (high)
            near = ((int64_t)high - 2) * GR_PAGE + shift;
        f->pages.near[2 * f->n_links * q + k] = (int32_t)near;
    }
}

static int add_wrap(struct gr_fluidity *f, int64_t to, int64_t from, int link)
{
    if (f->pages.n_wraps == f->pages.wrap_capacity) {
        const int64_t capacity = 2 * f->pages.wrap_capacity + 64;
        GR_RESIZE(f->pages.wrap, capacity);
        f->pages.wrap_capacity = capacity;
    }
    f->pages.wrap[f->pages.n_wraps++] = (struct gr_wrap){(int32_t)to, (int32_t)from, link, 0};
    return GR_OK;
}

/* List the links of one cell. */
static int link_cell(struct gr_fluidity *f, int64_t q, int lane)
{
    const int sides = 2 * f->n_links, back = f->pages.number[q] >= f->box_pages;
    const int64_t i = q * GR_PAGE + lane, cell = (f->pages.number[q] - (back ? f->box_pages : 0)) * GR_PAGE + lane;
    if (cell >= f->n_cells) return GR_OK;
    int64_t at[3];
    find_coordinates(f, cell, at);
    if (f->axisymmetric) f->space.radius[i] = f->first_radius + (double)at[0] + 0.5;
    if (f->pages.other) f->pages.other[i] = (int32_t)gr_fluidity_find(f, cell, !back);
    for (int k = 0; k < sides; k++) {
        const int8_t *o = f->offset[k / 2];
        const int sign = k % 2 ? 1 : -1, offset[3] = {sign * o[0], sign * o[1], sign * o[2]};
        const int64_t to = reach(f, cell, at, offset), j = gr_fluidity_find(f, to, back),
                      across = gr_fluidity_find(f, to, !back);
        if (f->pages.neighbour) f->pages.neighbour[i * sides + k] = (int32_t)(j < 0 ? across : j);
        if (k < 2 * f->dim && gr_fluidity_side(f, cell, k) == GR_SIDE_ROUGH)
            f->pages.rough_walls[i] += 2 * gr_fluidity_ring(f, cell, offset[0]);
        if (across >= 0 && to != cell && add_wrap(f, i, across, k)) return GR_ERR_MEMORY;
        if (j < 0 || j == i) continue;
        if (j != f->pages.near[sides * q + k] + lane) {
            if (add_wrap(f, i, j, k)) return GR_ERR_MEMORY;
        } else if (!f->pages.neighbour) {
            f->pages.link[k][i] = 1;
        }
    }
    return GR_OK;
}

/* Add the pages of the listed cells, or of all; or only count them, if `count` is not NULL. */
static int add_pages(struct gr_fluidity *f, const int64_t *cells, const int8_t *sides, int64_t n, int64_t *count)
{
    int error = GR_OK;
    int64_t last = -1;
    for (int back = 0; back <= (sides ? 1 : 0); back++)
        for (int64_t k = 0; !error && k < n; k++) {
            const int64_t page = cells ? cells[k] / GR_PAGE + (back ? f->box_pages : 0) : k;
            if (page == last || (back && sides[k] != -1)) continue;
            last = page;
            if (count)
                ++*count;
            else
                error = add_page(f, page);
        }
    if (!count) f->pages.chunk_first[f->pages.n_chunks] = f->pages.n;
    return error;
}

int gr_fluidity_cover(struct gr_fluidity *f, const int64_t *cells, const int8_t *sides, int64_t n)
{
    int64_t pages = 0;
    if (!cells) n = (f->n_cells + GR_PAGE - 1) / GR_PAGE;
    if (!f->two_sided) sides = 0;
    (void)add_pages(f, cells, sides, n, &pages);
    forget(f);
    int error = reserve(f, pages);
    if (!error) error = add_pages(f, cells, sides, n, 0);
    for (int64_t q = 0; !error && q < f->pages.n; q++) find_near(f, q);
    for (int64_t c = 0; !error && c < f->pages.n_chunks; c++) {
        f->pages.wrap_first[c] = f->pages.n_wraps;
        for (int64_t q = f->pages.chunk_first[c]; q < f->pages.chunk_first[c + 1]; q++)
            for (int lane = 0; !error && lane < GR_PAGE; lane++) error = link_cell(f, q, lane);
    }
    if (error)
        forget(f);
    else
        f->pages.wrap_first[f->pages.n_chunks] = f->pages.n_wraps;
    return error;
}
