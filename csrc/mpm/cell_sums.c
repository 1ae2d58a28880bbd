/* Memory of the sums of cells (cell_sums.h). */
#include "mpm/cell_sums.h"
#include "core/memory.h"

enum { LINE = 64 }; /* bytes of a line of the caches */

/* Bytes of points and sums above which the sums are stored past the caches, and points are fetched ahead. With 32 MB of
 * shared cache a step runs faster by the stores from between 9 and 14 MB on (measured; by a sixth at 25 MB, while it is slower
 * by a third at 5 MB), and by the fetches by another tenth at 12 to 25 MB; less was not tried. */
enum { CACHED = 12 << 20 };

int gr_reserve_sums(struct gr_engine *e, int64_t numbers)
{
    if (numbers <= e->sums.capacity) return GR_OK;
    const int64_t capacity = numbers + numbers / 2;
    void *block =
        gr_malloc(gr_bytes_of_sums(e, capacity + GR_LANES) + LINE); /* loads of whole vectors reach beyond the last */
    if (!block) return GR_ERR_MEMORY;
    gr_free(e->sums.block);
    e->sums.capacity = capacity;
    e->sums.block = block;
    e->sums.data = (char *)block + (LINE - (uintptr_t)block % LINE);
    return GR_OK;
}

void gr_note_size(struct gr_engine *e, int64_t numbers, int64_t slots)
{
    const size_t points = sizeof(double) * (size_t)((e->points.n_components + 1) * slots);
    e->out_of_cache = points + gr_bytes_of_sums(e, numbers) > CACHED;
}
