/* Lists of the cells about given cells, and of their nodes (spread.h).
 *
 * A row has the same indices along all axes but x. Each row of cells leads to a few rows; these are sorted, and each gets a
 * bit for each of its indices, which are set by all rows that lead to it. The bits are read in order. So each row of the
 * result is made by one chunk, and the result does not depend on the number of threads. */
#include "mpm/spread.h"

#include "core/memory.h"

enum { WORD = 64 };

/* A row that leads to another one. */
struct lead {
    int64_t to, row;
};

/* A row of the result: its number, what leads to it, its bits and where its indices begin in the list. */
struct row {
    int64_t number, lead, n_leads;
    int64_t low, word, n_words; /* bit 0 is index `low` of the row */
    int64_t begin;
};

struct spread {
    const struct gr_engine *e;
    enum gr_spread what;
    struct gr_team *team;
    int64_t chunks, n_x[2]; /* cells in a row; indices in a row of the result */
    const int64_t *cell;
    int64_t n_given, *given; /* where the rows of the given cells begin; n_given + 1 */
    int64_t n_leads, n_rows;
    struct lead *lead; /* twice as many, to sort them */
    struct row *row;
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

/* Find the rows of the given cells. */
static int find_given(struct spread *s, int64_t n)
{
    int64_t end = -1; /* of the row */
    s->n_given = 0;
    for (int64_t k = 0; k < n; k++)
        if (s->cell[k] >= end) end = (s->cell[k] / s->n_x[0] + 1) * s->n_x[0], s->n_given++;
    s->given = gr_malloc(sizeof *s->given * (size_t)(s->n_given + 1));
    if (!s->given) return GR_ERR_MEMORY;
    end = -1, s->n_given = 0;
    for (int64_t k = 0; k < n; k++)
        if (s->cell[k] >= end) end = (s->cell[k] / s->n_x[0] + 1) * s->n_x[0], s->given[s->n_given++] = k;
    s->given[s->n_given] = n;
    return GR_OK;
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
        const int64_t number = s->cell[s->given[r]] / s->n_x[0];
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

/* Widen the range [low, high] of a row by the indices to which a cell leads. */
static void widen(const struct spread *s, int64_t cell, int64_t *low, int64_t *high)
{
    int64_t to[3];
    lead_along(s->e, s->what, 0, cell % s->n_x[0], to);
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
        struct row *row = &s->row[s->n_rows++];
        int64_t low = INT64_MAX, high = -1;
        *row = (struct row){.number = s->lead[k].to, .lead = k, .word = words};
        for (; k < s->n_leads && s->lead[k].to == row->number; k++) {
            const int64_t r = s->lead[k].row;
            widen(s, s->cell[s->given[r]], &low, &high);
            widen(s, s->cell[s->given[r + 1] - 1], &low, &high);
        }
        row->n_leads = k - row->lead;
        row->low = low;
        row->n_words = (high - low) / WORD + 1;
        words += row->n_words;
    }
    return words;
}

/* Set the bits of the rows, and count them. */
GR_SHARED(set_bits, struct spread, s->n_rows, s)
{
    (void)chunk;
    for (struct row *row = s->row + first; row < s->row + last; row++) {
        uint64_t *bits = s->bits + row->word;
        memset(bits, 0, sizeof *bits * (size_t)row->n_words);
        for (int64_t k = row->lead; k < row->lead + row->n_leads; k++) {
            const int64_t r = s->lead[k].row, begin = s->cell[s->given[r]] / s->n_x[0] * s->n_x[0];
            for (int64_t c = s->given[r]; c < s->given[r + 1]; c++) {
                int64_t to[3];
                lead_along(s->e, s->what, 0, s->cell[c] - begin, to);
                for (int a = 0; a < 3; a++)
                    if (to[a] >= 0) bits[(to[a] - row->low) / WORD] |= (uint64_t)1 << (to[a] - row->low) % WORD;
            }
        }
        for (int64_t w = row->begin = 0; w < row->n_words; w++) row->begin += __builtin_popcountll(bits[w]);
    }
}

/* List the indices of the bits. */
GR_SHARED(read_bits, struct spread, s->n_rows, s)
{
    (void)chunk;
    for (const struct row *row = s->row + first; row < s->row + last; row++) {
        int64_t *out = s->out + row->begin;
        for (int64_t w = 0; w < row->n_words; w++)
            for (uint64_t bits = s->bits[row->word + w]; bits; bits &= bits - 1)
                *out++ = row->number * s->n_x[1] + row->low + w * WORD + __builtin_ctzll(bits);
    }
}

int gr_spread(const struct gr_engine *e, enum gr_spread what, const int64_t *cells, int64_t n, struct gr_team *team,
              int64_t chunks, int64_t **out, int64_t *n_out)
{
    const int64_t places = what == GR_SPREAD_NODES ? e->axis[0].n_nodes : e->axis[0].n_cells;
    const size_t most = e->config.dim == 2 ? 3 : 9; /* rows to which one leads */
    struct spread s = {
        .e = e, .what = what, .team = team, .chunks = chunks, .n_x = {e->axis[0].n_cells, places}, .cell = cells};
    struct lead *leads = 0;
    int error = GR_ERR_MEMORY;
    *n_out = 0;
    if (find_given(&s, n)) goto out;
    leads = s.lead = gr_malloc(sizeof *leads * (2 * most * (size_t)s.n_given + 1));
    if (!leads) goto out;
    list_leads(&s);
    s.row = gr_malloc(sizeof *s.row * (size_t)(s.n_leads + 1));
    if (!s.row) goto out;
    s.bits = gr_malloc(sizeof *s.bits * (size_t)(list_rows(&s) + 1));
    if (!s.bits) goto out;
    set_bits(&s);
    for (int64_t r = 0; r < s.n_rows; r++) {
        const int64_t count = s.row[r].begin;
        s.row[r].begin = *n_out;
        *n_out += count;
    }
    s.out = gr_malloc(sizeof *s.out * (size_t)(*n_out + 1));
    if (!s.out) goto out;
    read_bits(&s);
    *out = s.out;
    error = GR_OK;
out:
    gr_free(s.given);
    gr_free(leads);
    gr_free(s.row);
    gr_free(s.bits);
    return error;
}
