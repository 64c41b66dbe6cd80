/* What the step on the covariance itself hands over: rows in three lanes each, (mu_1..mu_n), (rho_s, v), (omega_1..omega_n). */
#ifndef TG_DIRECT_H
#define TG_DIRECT_H
#include "filter.h"

#if defined(TG_FLOAT)
#define TGI_DIRECT 0 /* seven digits: what is left never holds the bound */
#else
#define TGI_DIRECT 1
#endif

/* The two halves of the bound. P' = F P F' + Q is at least its noise, so at least this share of its diagonal; and a channel leaves at
 * least R/S of what was there. The product of both shares is ten thousand times the rounding. */
#define TGI_NOISE_SHARE ((tg_real)1e-5)
#define TGI_FACTOR_STEPS 16 /* with factors, after the bound did not hold */

typedef struct {
    tg_lanes mu, rest, omega;
} tgi_gain;

typedef struct { /* of the rows of mu only what is against mu */
    tg_lanes mu[TG_LANES], rho_mu, rho_rest, rho_omega, v_mu, v_rest, v_omega;
    tg_lanes omega_mu[TG_LANES], omega_rest[TG_LANES], omega[TG_LANES];
} tgi_block;

typedef struct {
    tgi_block P;
    tgi_gain x, x_prior, gain[TG_LANES + 2];
    int32_t used;
    tgi_result *result; /* of it: channels, residuals, innovations, weights, square, volume */
} tgi_direct;

/* Whether the bound holds and every number is finite; else `out` and its result are of no use. */
int tgi_direct_step(const tg_filter *f, const tgi_plan *plan, tgi_direct *out);
void tgi_direct_gains(const tgi_direct *out, tg_real (*gain)[TG_ROWS], int n); /* in row order */
void tgi_direct_commit(tg_filter *f, const tgi_direct *out);
#endif
