/* Places from numbers (places.h). */
#include "mpm/places.h"

#include "core/memory.h"
#include "mpm/device.h"

struct places {
    struct gr_engine *e;
    struct gr_team *team;
    int64_t chunks, *number, *of_chunk; /* the sum of the numbers of a chunk, then of those before */
};

/* Replace n numbers by `begin` and the sums of those before them. Returned: the end of all. */
static int64_t place(int64_t *number, int64_t n, int64_t begin)
{
    for (int64_t k = 0; k < n; k++) {
        const int64_t next = begin + number[k];
        number[k] = begin;
        begin = next;
    }
    return begin;
}

GR_DEFINE_PASS(sum_numbers, struct places, p)
{
    int64_t sum = 0;
    for (int64_t k = first; k < last; k++) sum += p->number[k];
    p->of_chunk[chunk] = sum;
}

GR_DEFINE_PASS(place_numbers, struct places, p) { (void)place(p->number + first, last - first, p->of_chunk[chunk]); }

#ifndef GR_ON_DEVICE
/* A device does it in chunks, so that the processor sees a number of each of these alone. */
static int place_on_device(struct gr_engine *e, int64_t *number, int64_t n, int64_t *end)
{
    const int64_t chunks = gr_pass_chunks(e, n, 1);
    struct places p = {.e = e, .chunks = chunks, .number = number};
    p.of_chunk = gr_malloc(sizeof *p.of_chunk * (size_t)chunks);
    if (!p.of_chunk) return GR_ERR_MEMORY;
    GR_MAKE_IN(sum_numbers, &p, n, chunks);
    int error = gr_device_wait(e);
    if (!error) {
        *end = place(p.of_chunk, chunks, *end);
        GR_MAKE_IN(place_numbers, &p, n, chunks);
        error = gr_device_wait(e);
    }
    gr_free(p.of_chunk);
    return error;
}

int gr_make_places(struct gr_engine *e, int64_t *number, int64_t n, int64_t *end)
{
    const int error = gr_device_wait(e);
    if (error) return error;
    if (e->device && n > GR_GROUP) return place_on_device(e, number, n, end);
    *end = place(number, n, *end);
    return GR_OK;
}
#endif
