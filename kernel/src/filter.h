/* Inside the filter: what its files share.
 *
 * Rows run (mu_1..mu_n, rho_s, v, omega_1..omega_n), "row order": parameters first, because then a measured output touches only the
 * last columns of an upper triangular factor. The covariance is P = U diag(d) U', U unit upper triangular, kept by columns of `stride`
 * reals with zeros below the diagonal. */
#ifndef TG_FILTER_H
#define TG_FILTER_H
#include "lanes.h"

#define TG_SUBSTEP ((tg_real)0.25)  /* largest r rho_w/J h of one Runge-Kutta step */
#define TG_SUBSTEPS_MAX 1000000     /* a longer dt is refused */
#define TG_LN_2PI ((tg_real)1.8378770664093454836)
#define TG_TWICE(n) (2 * (n) + 2)

typedef struct { /* one step, worked out before any state is touched; rows in row order */
    tg_passage passage;          /* its q: without the walk's share in a bank */
    tg_real shift[TG_ROWS];      /* what the inputs add to omega and v */
    tg_real accelerometer[TG_ROWS];
    tg_real accelerometer_shift;
    tg_real y[TG_MAX_CHANNELS], r[TG_MAX_CHANNELS]; /* channels run as rows do, see tgi_channel */
    int32_t present[TG_MAX_CHANNELS];
    int32_t count;               /* channels present */
    tg_real cosine[2], sine[2];  /* of the slopes before and now */
    int32_t substeps;
    tg_real gamma;
    const tg_input *before;
} tgi_plan;

typedef struct { /* what a step comes to, before it is known to be sound */
    tg_real x[TG_ROWS], d[TG_ROWS], u[TG_MAX_STATES * TG_ROWS]; /* 0 beyond the last row */
    tg_real x_prior[TG_ROWS];
    int32_t used;
    int32_t channel[TG_MAX_CHANNELS];
    tg_real gain[TG_MAX_CHANNELS][TG_ROWS];  /* each after the channels before it */
    tg_real residual[TG_MAX_CHANNELS];       /* innovation after the channels before it, and its variance */
    tg_real residual_variance[TG_MAX_CHANNELS];
    tg_real innovation[TG_MAX_CHANNELS], variance[TG_MAX_CHANNELS], weight[TG_MAX_CHANNELS]; /* prior */
    tg_real square, volume; /* sum of residual^2/variance and product of the variances, over the channels used */
    tg_real log_likelihood;
} tgi_result;

/* Row of the state's place e (omega, v, mu, rho_s). */
TG_INLINE int tgi_row(int n, int e) { return e < n ? n + 2 + e : e == n ? n + 1 : e - n - 1; }
/* Channels inside run like their rows: v, omega_1..omega_n, a_x; the first n + 1 measure row n + 1 + o. Place in the public order: */
TG_INLINE int tgi_channel(int n, int o) { return o == 0 ? n : o <= n ? o - 1 : o; }
/* Distance between columns for n wheels: the states in whole lanes. */
TG_INLINE int tgi_stride(int n) { return (TG_TWICE(n) + TG_LANES - 1) / TG_LANES * TG_LANES; }

TG_INLINE int tgi_finite(tg_real x) { return x - x == 0; }
TG_INLINE int tgi_positive(tg_real x) { return x > 0 && tgi_finite(x); }
TG_INLINE int tgi_not_negative(tg_real x) { return x >= 0 && tgi_finite(x); }
/* SD of a variance that rounding may have left below zero. */
TG_INLINE tg_real tgi_root(tg_real variance) { return tgi_sqrt(variance > 0 ? variance : 0); }
TG_INLINE tg_real tgi_inverse_mass(const tg_filter *f, const tg_input *u) { return u->mass > 0 ? 1 / u->mass : f->inverse_mass; }

/* Innovation weight of physics.md 6 (Huber): 1 within `huber` SDs, then falling. */
TG_INLINE tg_real tgi_weight(tg_real huber, tg_real innovation, tg_real variance)
{
    if (!(huber > 0) || innovation * innovation <= huber * huber * variance) return 1;
    return huber * tgi_sqrt(variance) / tgi_fabs(innovation);
}

typedef struct { /* of P = U diag(d) U', columns `stride` apart */
    const tg_real *u, *d;
} tgi_factors;

/* exact.c, unscented.c: the prior and posterior of a filter with one lane. */
void tgi_exact_step(const tg_filter *f, const tgi_factors *from, const tgi_plan *plan, tgi_result *result);
void tgi_unscented_step(const tg_filter *f, const tgi_plan *plan, tgi_result *result);

/* adaptation.c: initial scales; sensitivities and noise scales over this step; TG_DIVERGED and nothing changed where they leave the
 * finite numbers. */
void tgi_adaptation_init(tg_filter *f);
tg_status tgi_adapt(tg_filter *f, const tgi_plan *plan, const tgi_result *result);

/* supervisor.c: gamma of this step, and what to remember of it once the step is valid. */
void tgi_supervisor_init(tg_filter *f);
tg_real tgi_supervise(const tg_filter *f, const tgi_plan *plan, const tg_input *now);
void tgi_supervisor_remember(tg_filter *f, const tgi_plan *plan, const tg_input *now);

/* bank.c: initial lanes from one; the whole step; mixture. */
void tgi_bank_init(tg_filter *f);
tg_status tgi_bank_step(tg_filter *f, tgi_plan *plan, tg_step *out);
void tgi_bank_moments(const tg_filter *f, tg_real *x, tg_real *P); /* row order, P by rows of `stride` */
void tgi_bank_restart(tg_filter *f, const tg_real *outputs, tg_passage *passage);
void tgi_bank_factors_of(const tg_filter *f, int mode, tg_real *u, tg_real *d); /* as tgi_factors_of */

/* smoother.c: rows of X: row <- row M^-1, by Cholesky of the symmetric M, which is overwritten. 0 where M is not positive definite. */
int tgi_divide_rows(int states, int stride, tg_real *M, tg_real *X);

/* filter_restart.c */
void tgi_place_adhesion(tg_filter *f, const tg_real *mu);

/* factor.c */
tg_status tgi_factorise(int rows, int stride, const tg_real *P, tg_real *u, tg_real *d);
void tgi_covariance(int rows, int stride, const tg_real *u, const tg_real *d, tg_real *P);
tg_status tgi_factors_of(const tg_filter *f, tg_real *u, tg_real *d); /* without a bank, whichever the filter holds */
void tgi_covariance_of(const tg_filter *f, tg_real *P);
#endif
