/* Blocks of the memory of a device (blocks.h). */
#include "gpu/blocks.h"

#include <pthread.h>
#include <stdint.h>
#include <string.h>

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static struct gr_link *first;

/* Blocks that are kept, the oldest first. They are described here, so that their own memory stays where it is. */
static struct {
    const struct gr_pool *pool;
    struct gr_link *link;
    size_t bytes;
} kept[64];
enum { MOST_KEPT = sizeof kept / sizeof *kept };
static int n_kept;
static size_t bytes_in_use, bytes_kept;

/* Take a block out of those that are kept. */
static struct gr_link *take_kept(int k)
{
    struct gr_link *link = kept[k].link;
    bytes_kept -= kept[k].bytes;
    memmove(&kept[k], &kept[k + 1], sizeof *kept * (size_t)(--n_kept - k));
    return link;
}

/* Drop the oldest blocks until at most so many bytes are kept. */
static void drop_kept(size_t most)
{
    while (n_kept && bytes_kept > most) {
        const struct gr_pool *pool = kept[0].pool;
        pool->drop(take_kept(0));
    }
}

/* The smallest of those that serve as a block of this size, and are not twice as large; NULL if there is none. */
static struct gr_link *find_kept(const struct gr_pool *pool, size_t *bytes)
{
    int best = -1;
    for (int k = 0; k < n_kept; k++)
        if (kept[k].pool == pool && kept[k].bytes >= *bytes && kept[k].bytes / 2 <= *bytes &&
            (best < 0 || kept[k].bytes < kept[best].bytes))
            best = k;
    if (best < 0) return NULL;
    *bytes = kept[best].bytes;
    return take_kept(best);
}

/* A size that serves others, too, which are larger by up to a sixteenth. */
static size_t rounded_up(size_t bytes)
{
    size_t unit = sizeof(struct gr_link);
    while (2 * unit <= bytes / 16) unit *= 2;
    return (bytes + unit - 1) / unit * unit;
}

void *gr_take_block(const struct gr_pool *pool, size_t bytes)
{
    if (bytes > SIZE_MAX / 2) return NULL;
    bytes = rounded_up(bytes);
    pthread_mutex_lock(&guard);
    struct gr_link *link = find_kept(pool, &bytes);
    if (!link) link = pool->raw(bytes + sizeof *link);
    if (!link) {
        drop_kept(0);
        link = pool->raw(bytes + sizeof *link);
    }
    if (link) {
        *link = (struct gr_link){.next = first, .bytes = bytes};
        if (first) first->last = link;
        first = link;
        bytes_in_use += bytes;
    }
    pthread_mutex_unlock(&guard);
    return link ? link + 1 : NULL;
}

void gr_give_block(const struct gr_pool *pool, void *block)
{
    enum { SHARE_KEPT = 4 };
    struct gr_link *link = (struct gr_link *)block - 1;
    pthread_mutex_lock(&guard);
    if (link->next) link->next->last = link->last;
    if (link->last)
        link->last->next = link->next;
    else
        first = link->next;
    bytes_in_use -= link->bytes;
    if (n_kept == MOST_KEPT) drop_kept(bytes_kept - 1);
    kept[n_kept].pool = pool, kept[n_kept].link = link, kept[n_kept].bytes = link->bytes;
    bytes_kept += kept[n_kept++].bytes;
    drop_kept(bytes_in_use / SHARE_KEPT);
    pthread_mutex_unlock(&guard);
}

int gr_in_block(const void *address)
{
    const char *const at = address;
    int holds = 0;
    pthread_mutex_lock(&guard);
    for (const struct gr_link *link = first; link && !holds; link = link->next)
        holds = at >= (const char *)(link + 1) && at <= (const char *)(link + 1) + link->bytes;
    pthread_mutex_unlock(&guard);
    return holds;
}

void gr_each_block(void (*visit)(void *begin, size_t bytes))
{
    pthread_mutex_lock(&guard);
    for (struct gr_link *link = first; link; link = link->next) visit(link, link->bytes + sizeof *link);
    pthread_mutex_unlock(&guard);
}
