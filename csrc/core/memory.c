/* Memory of the core (memory.h). */
#include "core/memory.h"

#include <stdalign.h>
#include <stddef.h>
#include <stdint.h>

/* What stands before a block. */
struct head {
    alignas(max_align_t) const struct gr_source *source; /* NULL: the process */
    size_t bytes;
};

static _Thread_local const struct gr_source *used;

void gr_use_source(const struct gr_source *source) { used = source; }

static struct head *head_of(const void *block) { return (struct head *)block - 1; }

/* A block of a source behind its head. */
static void *begin(struct head *head, const struct gr_source *source, size_t bytes)
{
    if (!head) return NULL;
    *head = (struct head){source, bytes};
    return head + 1;
}

void *gr_malloc(size_t bytes)
{
    const struct gr_source *source = used;
    if (bytes > SIZE_MAX - sizeof(struct head)) return NULL;
    const size_t all = bytes + sizeof(struct head);
    return begin(source ? source->take(all) : malloc(all), source, bytes);
}

void *gr_calloc(size_t count, size_t bytes)
{
    const struct gr_source *source = used;
    if (bytes && count > (SIZE_MAX - sizeof(struct head)) / bytes) return NULL;
    if (!source) return begin(calloc(1, count * bytes + sizeof(struct head)), NULL, count * bytes);
    void *block = gr_malloc(count * bytes);
    if (block) memset(block, 0, count * bytes);
    return block;
}

void *gr_realloc(void *block, size_t bytes)
{
    if (!block) return gr_malloc(bytes);
    struct head *head = head_of(block);
    if (bytes > SIZE_MAX - sizeof *head) return NULL;
    if (!head->source) return begin(realloc(head, bytes + sizeof *head), NULL, bytes);
    struct head *moved = head->source->take(bytes + sizeof *head);
    if (!moved) return NULL;
    memcpy(moved + 1, block, bytes < head->bytes ? bytes : head->bytes);
    const struct gr_source *source = head->source;
    source->give(head);
    return begin(moved, source, bytes);
}

void gr_free(const void *block)
{
    if (!block) return;
    struct head *head = head_of(block);
    if (head->source)
        head->source->give(head);
    else
        free(head);
}
