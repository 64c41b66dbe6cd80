/* The kernel's arithmetic: functions of tg_real, and four numbers that are computed on at once. Where the compiler has vectors this wide they are one register; elsewhere plain C99, with
 * the same order of operations and so the same bits. */
#ifndef TG_LANES_H
#define TG_LANES_H
#include "terragrip.h"
#include <float.h>
#include <math.h>
#include <string.h>

#ifdef TG_FLOAT
#define tgi_sqrt sqrtf
#define tgi_fabs fabsf
#define tgi_log logf
#define tgi_exp expf
#define tgi_expm1 expm1f
#define tgi_cos cosf
#define tgi_sin sinf
#define tgi_ceil ceilf
#define TG_TINY 1e-36f /* keeps a factor's d above zero; far below the rounding of any variance */
#define TG_LARGEST FLT_MAX
#else
#define tgi_sqrt sqrt
#define tgi_fabs fabs
#define tgi_log log
#define tgi_exp exp
#define tgi_expm1 expm1
#define tgi_cos cos
#define tgi_sin sin
#define tgi_ceil ceil
#define TG_TINY 1e-290
#define TG_LARGEST DBL_MAX
#endif

#if defined(__GNUC__)
#define TG_INLINE static inline __attribute__((always_inline, unused))
#else
#define TG_INLINE static inline
#endif

#define TG_LANES 4

#if defined(__GNUC__) && !defined(TG_PLAIN_LANES) && \
    (defined(__AVX__) || (defined(TG_FLOAT) && (defined(__SSE2__) || defined(__ARM_NEON))))
typedef tg_real tg_lanes __attribute__((vector_size(TG_LANES * sizeof(tg_real))));

#define TG_LANES_OF(a, b, c, d) {a, b, c, d}
TG_INLINE tg_lanes lanes_all(tg_real x) { return (tg_lanes){x, x, x, x}; }
TG_INLINE tg_lanes lanes_add(tg_lanes a, tg_lanes b) { return a + b; }
TG_INLINE tg_lanes lanes_sub(tg_lanes a, tg_lanes b) { return a - b; }
TG_INLINE tg_lanes lanes_mul(tg_lanes a, tg_lanes b) { return a * b; }
TG_INLINE tg_lanes lanes_div(tg_lanes a, tg_lanes b) { return a / b; }
TG_INLINE tg_lanes lanes_mul_add(tg_lanes a, tg_lanes b, tg_lanes c) { return c + a * b; }
TG_INLINE tg_lanes lanes_mul_sub(tg_lanes a, tg_lanes b, tg_lanes c) { return c - a * b; }
TG_INLINE tg_real lanes_at(tg_lanes a, int i) { return a[i]; }
#if defined(__clang__)
TG_INLINE tg_lanes lanes_spread(tg_lanes a, int i) { return lanes_all(a[i]); }
#else
#ifdef TG_FLOAT
typedef int32_t tg_places __attribute__((vector_size(TG_LANES * sizeof(int32_t))));
#else
typedef int64_t tg_places __attribute__((vector_size(TG_LANES * sizeof(int64_t))));
#endif
TG_INLINE tg_lanes lanes_spread(tg_lanes a, int i) { return __builtin_shuffle(a, (tg_places){i, i, i, i}); }
#endif
#else
typedef struct {
    tg_real at[TG_LANES];
} tg_lanes;

#define TG_LANES_OF(a, b, c, d) {{a, b, c, d}}
#define LANES_EACH(expression)                                    \
    do {                                                          \
        for (int i = 0; i < TG_LANES; i++) a.at[i] = expression; \
        return a;                                                 \
    } while (0)
TG_INLINE tg_lanes lanes_all(tg_real x) { return (tg_lanes){{x, x, x, x}}; }
TG_INLINE tg_lanes lanes_add(tg_lanes a, tg_lanes b) { LANES_EACH(a.at[i] + b.at[i]); }
TG_INLINE tg_lanes lanes_sub(tg_lanes a, tg_lanes b) { LANES_EACH(a.at[i] - b.at[i]); }
TG_INLINE tg_lanes lanes_mul(tg_lanes a, tg_lanes b) { LANES_EACH(a.at[i] * b.at[i]); }
TG_INLINE tg_lanes lanes_div(tg_lanes a, tg_lanes b) { LANES_EACH(a.at[i] / b.at[i]); }
TG_INLINE tg_lanes lanes_mul_add(tg_lanes a, tg_lanes b, tg_lanes c) { LANES_EACH(c.at[i] + a.at[i] * b.at[i]); }
TG_INLINE tg_lanes lanes_mul_sub(tg_lanes a, tg_lanes b, tg_lanes c) { LANES_EACH(c.at[i] - a.at[i] * b.at[i]); }
TG_INLINE tg_real lanes_at(tg_lanes a, int i) { return a.at[i]; }
TG_INLINE tg_lanes lanes_spread(tg_lanes a, int i) { return lanes_all(a.at[i]); }
#undef LANES_EACH
#endif

TG_INLINE tg_lanes lanes_of(tg_real a, tg_real b, tg_real c, tg_real d)
{
    const tg_lanes all = TG_LANES_OF(a, b, c, d);
    return all;
}
TG_INLINE tg_lanes lanes_load(const tg_real *p)
{
    tg_lanes a;
    memcpy(&a, p, sizeof a);
    return a;
}
TG_INLINE void lanes_store(tg_real *p, tg_lanes a) { memcpy(p, &a, sizeof a); }
TG_INLINE tg_real lanes_sum(tg_lanes a)
{
    return (lanes_at(a, 0) + lanes_at(a, 1)) + (lanes_at(a, 2) + lanes_at(a, 3));
}
#endif
