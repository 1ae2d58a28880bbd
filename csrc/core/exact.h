/* Exact sums of doubles. A sum holds every bit of its terms, so that it depends neither on their order nor on who added which
 * of them: sums of several processes are added up number by number. Only the value that is read is rounded.
 *
 * The bits of all doubles, from 2^-1074 to 2^1024, are divided into digits of 32 bits, which may be negative or carry over
 * until they are read (Kulisch, Computer Arithmetic and Validity, 2013). */
#pragma once

#include <stdint.h>

enum {
    GR_EXACT_DIGITS = 68,
    GR_EXACT_NUMBERS = GR_EXACT_DIGITS + 4 /* of a sum: its digits; terms since they were carried; infinities; NaN */
};

struct gr_exact {
    int64_t digit[GR_EXACT_DIGITS];
    int64_t terms, plus, minus, nan; /* terms since the last carry; those that are infinite, or not a number */
};

_Static_assert(sizeof(struct gr_exact) == GR_EXACT_NUMBERS * sizeof(int64_t), "a sum is an array of integers");

void gr_exact_add(struct gr_exact *sum, double x);

/* Add the terms of another sum. */
void gr_exact_join(struct gr_exact *sum, const struct gr_exact *other);

/* Carry over, so that the digits of several sums may be added up. */
void gr_exact_carry(struct gr_exact *sum);

/* The value of a sum, with a relative error of 2^-52 at most; the same for equal sums. */
double gr_exact_value(const struct gr_exact *sum);
