/* Exact sums of doubles (exact.h). */
#include "core/exact.h"

#include <math.h>
#include <string.h>

enum {
    BITS = 32,
    FRACTION = 52, /* bits of a double behind the point; below them the exponent */
    LOWEST = 1074, /* a double is a multiple of 2^-LOWEST */
    MOST_TERMS = 1 << 30
};

void gr_exact_carry(struct gr_exact *sum)
{
    int64_t carry = 0;
    for (int i = 0; i < GR_EXACT_DIGITS - 1; i++) {
        const int64_t digit = sum->digit[i] + carry;
        carry = digit >> BITS; /* towards minus infinity, with the sign */
        sum->digit[i] = digit - carry * ((int64_t)1 << BITS);
    }
    sum->digit[GR_EXACT_DIGITS - 1] += carry;
    sum->terms = 0;
}

void gr_exact_add(struct gr_exact *sum, double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    const int exponent = (int)(bits >> FRACTION & 0x7FF);
    uint64_t fraction = bits & (((uint64_t)1 << FRACTION) - 1);
    if (exponent == 0x7FF) {
        sum->nan += fraction != 0;
        sum->plus += !fraction && x > 0;
        sum->minus += !fraction && x < 0;
        return;
    }
    if (exponent) fraction |= (uint64_t)1 << FRACTION;
    const int place = exponent ? exponent - 1 : 0, shift = place % BITS;
    const unsigned __int128 shifted = (unsigned __int128)fraction << shift;
    int64_t *const digit = sum->digit + place / BITS;
    const int64_t sign = bits >> 63 ? -1 : 1;
    for (int i = 0; i < 3; i++) digit[i] += sign * (int64_t)(uint32_t)(shifted >> (i * BITS));
    if (++sum->terms == MOST_TERMS) gr_exact_carry(sum);
}

void gr_exact_join(struct gr_exact *sum, const struct gr_exact *other)
{
    if (sum->terms + other->terms >= MOST_TERMS) gr_exact_carry(sum);
    for (int i = 0; i < GR_EXACT_DIGITS; i++) sum->digit[i] += other->digit[i];
    sum->terms += other->terms, sum->plus += other->plus, sum->minus += other->minus, sum->nan += other->nan;
}

double gr_exact_value(const struct gr_exact *sum)
{
    struct gr_exact all = *sum;
    if (all.nan || (all.plus && all.minus)) return NAN;
    if (all.plus || all.minus) return all.plus ? INFINITY : -INFINITY;
    gr_exact_carry(&all);
    const int negative = all.digit[GR_EXACT_DIGITS - 1] < 0;
    for (int i = 0; negative && i < GR_EXACT_DIGITS; i++) all.digit[i] = -all.digit[i];
    if (negative) gr_exact_carry(&all);
    int top = GR_EXACT_DIGITS - 1;
    while (top > 2 && !all.digit[top]) top--;
    double value = 0;
    for (int i = top; i >= top - 2; i--) value += ldexp((double)all.digit[i], i * BITS - LOWEST);
    return negative ? -value : value;
}
