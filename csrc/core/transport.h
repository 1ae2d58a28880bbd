/* How the processes of a run reach each other: functions of the caller, so that the core knows no library for it. All
 * processes call the same functions in the same order. */
#pragma once

#include <stdint.h>

/* A message to a process and the one from it; their sizes are known to both. */
struct gr_message {
    int rank;
    int64_t out_bytes, in_bytes;
    void *out, *in;
};

struct gr_transport {
    void *context;
    int rank, size; /* number of this process, and how many there are */
    /* Send and receive n messages. Returned, also by the next: 0, or not 0 if a process has not answered. */
    int (*exchange)(void *context, const struct gr_message *message, int n);
    /* Add up n integers over all processes, in place. */
    int (*sum)(void *context, int64_t *number, int64_t n);
    /* Replace n numbers by the largest of all processes. */
    int (*largest)(void *context, double *number, int64_t n);
};
