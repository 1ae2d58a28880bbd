/* Blocks of the memory of a device (blocks.h). */
#include "gpu/blocks.h"

#include <pthread.h>
#include <stdint.h>

static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
static struct gr_link *first;

void *gr_take_block(void *(*raw)(size_t), size_t bytes)
{
    struct gr_link *link = bytes <= SIZE_MAX - sizeof *link ? raw(bytes + sizeof *link) : NULL;
    if (!link) return NULL;
    pthread_mutex_lock(&guard);
    *link = (struct gr_link){.next = first, .bytes = bytes};
    if (first) first->last = link;
    first = link;
    pthread_mutex_unlock(&guard);
    return link + 1;
}

void gr_give_block(void (*drop)(void *), void *block)
{
    struct gr_link *link = (struct gr_link *)block - 1;
    pthread_mutex_lock(&guard);
    if (link->next) link->next->last = link->last;
    if (link->last)
        link->last->next = link->next;
    else
        first = link->next;
    pthread_mutex_unlock(&guard);
    drop(link);
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
