/* What the fuzzer's bytes stand for: counts, and numbers of every kind that a caller could hand in. */
#ifndef TG_FUZZ_BYTES_H
#define TG_FUZZ_BYTES_H
#include "driven.h"
#include <float.h>

typedef struct {
    const uint8_t *at;
    size_t left;
} bytes_left;

static inline unsigned byte_of(bytes_left *b)
{
    if (!b->left) return 0;
    b->left--;
    return *b->at++;
}

static inline tg_real raw_number(bytes_left *b)
{
    uint8_t raw[sizeof(tg_real)];
    tg_real value;
    for (size_t k = 0; k < sizeof raw; k++) raw[k] = (uint8_t)byte_of(b);
    memcpy(&value, raw, sizeof value);
    return value;
}

/* Mostly what a machine would say, else any bits at all or one of the numbers that break arithmetic. */
static inline tg_real number(bytes_left *b)
{
    static const tg_real odd[16] = {
        (tg_real)NAN,     (tg_real)INFINITY, -(tg_real)INFINITY,     0,
        -(tg_real)0.0,    (tg_real)FLT_MAX,  -(tg_real)FLT_MAX,      (tg_real)FLT_MIN,
        (tg_real)1e-42,   (tg_real)-1e-42,   (tg_real)FLT_EPSILON,   (tg_real)1e-20,
        (tg_real)-1e20,   (tg_real)DBL_MAX,  (tg_real)4.9406565e-324, (tg_real)1e9};
    const unsigned kind = byte_of(b);
    if (kind < 96) return odd[kind % 16];
    if (kind < 128) return raw_number(b);
    const int high = (int)byte_of(b) - 128;
    const tg_real small = (tg_real)high + (tg_real)byte_of(b) / 256;
    return kind < 192 ? small : small * (tg_real)0.01;
}
#endif
