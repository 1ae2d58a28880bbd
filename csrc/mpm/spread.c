/* Lists of the cells about given cells, and of their nodes (spread.h).
 *
 * A row has the same indices along all axes but x. Each row of cells leads to a few rows; these are sorted, and each gets a
 * bit for each of its indices, which are set by all rows that lead to it. The bits are read in order. So each row of the
 * result is made by one chunk, and the result does not depend on the number of threads. */
#include "mpm/spread.h"

#include "core/memory.h"
#include "mpm/device.h"
#include "mpm/places.h"

enum { WORD = 64 };

/* A row of the given cells: its number, which of them are in it, and where along the row the first and the last one are. */
struct given {
    int64_t number, begin, end, low, high;
};

/* A row that leads to another one. */
struct lead {
    int64_t to, row;
};

/* A row of the result: its number, what leads to it, its bits and where its indices begin in the list. */
struct bit_row {
    int64_t number, lead, n_leads;
    int64_t low, word, n_words; /* bit 0 is index `low` of the row */
    int64_t begin;
};

struct spread {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks;
    enum gr_spread what;
    int64_t n_x[2]; /* cells in a row; indices in a row of the result */
    const int64_t *cell;
    int64_t n_given, *rows_of; /* rows; per chunk of the cells: rows that begin in it, then those that begin before */
    struct given *given;
    int64_t n_leads, n_rows;
    struct lead *lead; /* twice as many, to sort them */
    struct bit_row *row;
    uint64_t *bits;
    int64_t *out;
};

/* Indices along axis d to which index i of a cell leads; -1 where there is none. */
static void lead_along(const struct gr_engine *e, enum gr_spread what, int d, int64_t i, int64_t to[3])
{
    const struct gr_axis *axis = &e->axis[d];
    for (int a = 0; a < 3; a++) {
        const int64_t near = i + a - 1, n = axis->n_cells;
        if (d >= e->config.dim)
            to[a] = a ? -1 : 0;
        else if (what == GR_SPREAD_NODES)
            to[a] = a < gr_basis_nodes_1d(e->config.basis) ? axis->cell[i].node[a] : -1;
        else
            to[a] = axis->periodic ? (near + n) % n : near < n ? near : -1;
    }
}

/* True if cell k is the first in its row. */
static int begins_row(const struct spread *s, int64_t k)
{
    return !k || s->cell[k] / s->n_x[0] != s->cell[k - 1] / s->n_x[0];
}

GR_DEFINE_PASS(count_given_rows, struct spread, s)
{
    int64_t n = 0;
    for (int64_t k = first; k < last; k++) n += begins_row(s, k);
    s->rows_of[chunk] = n;
}

/* List the rows of the given cells. A row ends before the next one begins, perhaps in another chunk. */
GR_DEFINE_PASS(list_given_rows, struct spread, s)
{
    int64_t next = s->rows_of[chunk];
    for (int64_t k = first; k < last; k++) {
        if (!begins_row(s, k)) continue;
        if (k) s->given[next - 1].end = k, s->given[next - 1].high = s->cell[k - 1] % s->n_x[0];
        struct given *const given = &s->given[next++];
        given->number = s->cell[k] / s->n_x[0], given->begin = k, given->low = s->cell[k] % s->n_x[0];
    }
}

/* Set the bits of the rows, and count them. */
GR_DEFINE_PASS(set_bits, struct spread, s)
{
    for (struct bit_row *row = s->row + first; row < s->row + last; row++) {
        uint64_t *bits = s->bits + row->word;
        for (int64_t w = 0; w < row->n_words; w++) bits[w] = 0;
        for (int64_t k = row->lead; k < row->lead + row->n_leads; k++) {
            const struct given *given = &s->given[s->lead[k].row];
            for (int64_t c = given->begin; c < given->end; c++) {
                int64_t to[3];
                lead_along(e, s->what, 0, s->cell[c] - given->number * s->n_x[0], to);
                for (int a = 0; a < 3; a++)
                    if (to[a] >= 0) bits[(to[a] - row->low) / WORD] |= (uint64_t)1 << (to[a] - row->low) % WORD;
            }
        }
        for (int64_t w = row->begin = 0; w < row->n_words; w++) row->begin += __builtin_popcountll(bits[w]);
    }
}

/* List the indices of the bits. */
GR_DEFINE_PASS(read_bits, struct spread, s)
{
    for (const struct bit_row *row = s->row + first; row < s->row + last; row++) {
        int64_t *out = s->out + row->begin;
        for (int64_t w = 0; w < row->n_words; w++)
            for (uint64_t bits = s->bits[row->word + w]; bits; bits &= bits - 1)
                *out++ = row->number * s->n_x[1] + row->low + w * WORD + __builtin_ctzll(bits);
    }
}

#ifndef GR_ON_DEVICE
/* Find the rows of the n given cells. */
static int find_given(struct spread *s, int64_t n)
{
    const int64_t pieces = gr_pass_chunks(s->e, n, s->chunks);
    s->rows_of = gr_malloc(sizeof *s->rows_of * (size_t)(pieces + 1));
    if (!s->rows_of) return GR_ERR_MEMORY;
    GR_MAKE_IN(count_given_rows, s, n, pieces);
    int error = gr_make_places(s->e, s->rows_of, pieces, &s->n_given);
    s->given = gr_malloc(sizeof *s->given * (size_t)(s->n_given + 1));
    if (!s->given) return GR_ERR_MEMORY;
    if (!error) GR_MAKE_IN(list_given_rows, s, n, pieces);
    if (!error) error = gr_device_wait(s->e);
    if (n && !error) s->given[s->n_given - 1].end = n, s->given[s->n_given - 1].high = s->cell[n - 1] % s->n_x[0];
    return error;
}

/* Sort the leads by the row to which they lead, and keep the order of those to the same row. */
static void sort_leads(struct spread *s, int64_t largest)
{
    enum { BITS = 8 };
    struct lead *from = s->lead, *to = s->lead + s->n_leads;
    for (int shift = 0; shift < 63 && largest >> shift; shift += BITS) {
        int64_t begin[(1 << BITS) + 1] = {0};
        for (int64_t k = 0; k < s->n_leads; k++) begin[(from[k].to >> shift) % (1 << BITS) + 1]++;
        for (int b = 0; b < 1 << BITS; b++) begin[b + 1] += begin[b];
        for (int64_t k = 0; k < s->n_leads; k++) to[begin[(from[k].to >> shift) % (1 << BITS)]++] = from[k];
        struct lead *swap = from;
        from = to, to = swap;
    }
    s->lead = from;
}

/* List which rows the given ones lead to. */
static void list_leads(struct spread *s)
{
    const int dim = s->e->config.dim;
    const struct gr_axis *y = &s->e->axis[1];
    const int64_t rows_y = s->what == GR_SPREAD_NODES ? y->n_nodes : y->n_cells;
    int64_t largest = 0;
    s->n_leads = 0;
    for (int64_t r = 0; r < s->n_given; r++) {
        const int64_t number = s->given[r].number;
        int64_t to_y[3], to_z[3];
        lead_along(s->e, s->what, 1, number % y->n_cells, to_y);
        lead_along(s->e, s->what, 2, number / y->n_cells, to_z);
        for (int k = 0; k < (dim == 2 ? 3 : 9); k++) {
            if (to_y[k % 3] < 0 || to_z[k / 3] < 0) continue;
            const int64_t to = to_z[k / 3] * rows_y + to_y[k % 3];
            if (to > largest) largest = to;
            s->lead[s->n_leads++] = (struct lead){to, r};
        }
    }
    sort_leads(s, largest);
}

/* Widen the range [low, high] of a row by the indices to which a cell at x leads. */
static void widen(const struct spread *s, int64_t x, int64_t *low, int64_t *high)
{
    int64_t to[3];
    lead_along(s->e, s->what, 0, x, to);
    for (int a = 0; a < 3; a++) {
        if (to[a] < 0) continue;
        if (to[a] < *low) *low = to[a];
        if (to[a] > *high) *high = to[a];
    }
}

/* List the rows of the result. Across a periodic end only the last cells of a row lead to its beginning, so that its first
 * and last given cells tell how far it goes.
 * Returned: the number of words of bits. */
static int64_t list_rows(struct spread *s)
{
    int64_t words = 0;
    s->n_rows = 0;
    for (int64_t k = 0; k < s->n_leads;) {
        struct bit_row *row = &s->row[s->n_rows++];
        int64_t low = INT64_MAX, high = -1;
        *row = (struct bit_row){.number = s->lead[k].to, .lead = k, .word = words};
        for (; k < s->n_leads && s->lead[k].to == row->number; k++) {
            const struct given *given = &s->given[s->lead[k].row];
            widen(s, given->low, &low, &high);
            widen(s, given->high, &low, &high);
        }
        row->n_leads = k - row->lead;
        row->low = low;
        row->n_words = (high - low) / WORD + 1;
        words += row->n_words;
    }
    return words;
}

int gr_spread(struct gr_engine *e, enum gr_spread what, const int64_t *cells, int64_t n, struct gr_team *team,
              int64_t chunks, int64_t **out, int64_t *n_out)
{
    const int64_t places = what == GR_SPREAD_NODES ? e->axis[0].n_nodes : e->axis[0].n_cells;
    const size_t most = e->config.dim == 2 ? 3 : 9; /* rows to which one leads */
    struct spread s = {
        .e = e, .what = what, .team = team, .chunks = chunks, .n_x = {e->axis[0].n_cells, places}, .cell = cells};
    struct lead *leads = 0;
    *n_out = 0;
    int error = find_given(&s, n);
    if (error) goto out;
    error = GR_ERR_MEMORY;
    leads = s.lead = gr_malloc(sizeof *leads * (2 * most * (size_t)s.n_given + 1));
    if (!leads) goto out;
    list_leads(&s);
    s.row = gr_malloc(sizeof *s.row * (size_t)(s.n_leads + 1));
    if (!s.row) goto out;
    s.bits = gr_malloc(sizeof *s.bits * (size_t)(list_rows(&s) + 1));
    if (!s.bits) goto out;
    GR_MAKE(set_bits, &s, s.n_rows);
    error = gr_device_wait(e);
    for (int64_t r = 0; r < s.n_rows && !error; r++) {
        const int64_t count = s.row[r].begin;
        s.row[r].begin = *n_out;
        *n_out += count;
    }
    s.out = gr_malloc(sizeof *s.out * (size_t)(*n_out + 1));
    if (!s.out) error = GR_ERR_MEMORY;
    if (error) goto out;
    GR_MAKE(read_bits, &s, s.n_rows);
    error = gr_device_wait(e);
    if (!error) *out = s.out;
out:
    if (error) gr_free(s.out);
    gr_free(s.rows_of);
    gr_free(s.given);
    gr_free(leads);
    gr_free(s.row);
    gr_free(s.bits);
    return error;
}
#endif
