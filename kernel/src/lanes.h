/* The kernel's arithmetic: functions of tg_real, and four numbers that are computed on at once, by C's own operators; a number beside them
 * stands for four. A processor without registers this wide computes them in parts, in the same order of operations and so to the same bits. */
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
#define tgi_erfc erfcf
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
#define tgi_erfc erfc
#define tgi_cos cos
#define tgi_sin sin
#define tgi_ceil ceil
#define TG_TINY 1e-290
#define TG_LARGEST DBL_MAX
#endif

#ifndef __GNUC__
#error "the kernel needs the vector extension of C that GCC and Clang have on every processor"
#endif
#if defined(__FAST_MATH__) || __FINITE_MATH_ONLY__
#error "compile without -ffast-math, -Ofast and -ffinite-math-only: NaN means missing here, and what is not finite is refused"
#endif
#define TG_INLINE static inline __attribute__((always_inline, unused))

#define TG_LANES 4

#ifdef TG_FLOAT
typedef int32_t tg_choice_bits;
#else
typedef int64_t tg_choice_bits;
#endif
typedef tg_real tg_lanes __attribute__((vector_size(TG_LANES * sizeof(tg_real))));
typedef tg_choice_bits tg_choice __attribute__((vector_size(TG_LANES * sizeof(tg_real)))); /* all bits of a lane, or none: (tg_choice)(a > b) */

TG_INLINE tg_lanes lanes_all(tg_real x) { return (tg_lanes){x, x, x, x}; }
TG_INLINE tg_real lanes_at(tg_lanes a, int i) { return a[i]; }
TG_INLINE tg_lanes lanes_of(tg_real a, tg_real b, tg_real c, tg_real d) { return (tg_lanes){a, b, c, d}; }
TG_INLINE tg_lanes lanes_load(const tg_real *p)
{
    tg_lanes a;
    memcpy(&a, p, sizeof a);
    return a;
}
TG_INLINE void lanes_store(tg_real *p, tg_lanes a) { memcpy(p, &a, sizeof a); }
TG_INLINE tg_lanes lanes_where(tg_choice yes, tg_lanes a, tg_lanes b) { return (tg_lanes)((yes & (tg_choice)a) | (~yes & (tg_choice)b)); }
TG_INLINE tg_lanes lanes_max(tg_lanes a, tg_lanes b) { return lanes_where((tg_choice)(a > b), a, b); }
TG_INLINE tg_lanes lanes_min(tg_lanes a, tg_lanes b) { return lanes_where((tg_choice)(a < b), a, b); }
TG_INLINE tg_lanes lanes_fabs(tg_lanes a) { return (tg_lanes)((tg_choice)a & ~(tg_choice)lanes_all((tg_real)-0.0)); }
TG_INLINE tg_lanes lanes_sqrt(tg_lanes a) { return lanes_of(tgi_sqrt(a[0]), tgi_sqrt(a[1]), tgi_sqrt(a[2]), tgi_sqrt(a[3])); }
TG_INLINE tg_real lanes_sum(tg_lanes a) { return (a[0] + a[1]) + (a[2] + a[3]); }
/* The same of four at once, each rounded alike. */
TG_INLINE tg_lanes lanes_sums(const tg_lanes *a)
{
    const tg_lanes low = lanes_of(a[0][0], a[1][0], a[0][2], a[1][2]) + lanes_of(a[0][1], a[1][1], a[0][3], a[1][3]);
    const tg_lanes high = lanes_of(a[2][0], a[3][0], a[2][2], a[3][2]) + lanes_of(a[2][1], a[3][1], a[2][3], a[3][3]);
    return lanes_of(low[0], low[1], high[0], high[1]) + lanes_of(low[2], low[3], high[2], high[3]);
}
#endif
