/* Algebra of factors P = U diag(d) U' (docs/decisions/0001-ud-factors.md). Inlined, so that sizes are constants.
 *
 * Time update: P = W diag(weight) W' + diag(noise) is factored by modified weighted Gram-Schmidt (Thornton 1976; Bierman 1977, VI.4) on
 * the columns of [W | I], last row first. Every d is a sum of squares: it cannot become negative. A column of the identity is zero until
 * its row is taken, and joins the columns then. */
#ifndef TG_FACTOR_H
#define TG_FACTOR_H
#include "filter.h"

#define TG_MOST_LANES 7 /* 28 rows: 18 states and 10 channels */

typedef struct { /* a factorisation on its way from the last row to the first */
    tg_real *W, *weight;            /* columns `stride` apart, and their weights */
    int columns, stride;
    int previous;                   /* the row taken last */
    int joins;                      /* whether that row brings a column of its own, of weight `noise` */
    tg_real noise;
    tg_lanes part[TG_MOST_LANES];   /* that row's column of U; 0 before any */
} tgi_gram;

/* factor.c. W and its weights, with nothing taken yet. Entries of a column beyond its last row, up to the whole lane, must be numbers. */
tgi_gram tgi_factor_begin(tg_real *W, tg_real *weight, int columns, int stride);
/* Take row j: project the row before off every column and divide row j's products with all rows above it by its own. Gives column j of U
 * and d_j. `joins`: the row has noise of its own. */
void tgi_factor_row(tgi_gram *g, int j, int joins, tg_real noise, tg_real *u, tg_real *d);
/* Take row 0 after others: there is nothing above it. */
void tgi_factor_last(const tgi_gram *g, tg_real noise, tg_real *u, tg_real *d);

/* Measurement update by one channel (Bierman 1977, V.3; Thornton's gain). `f`: U'h, zero before column `first`; `spread`: sums of d f^2
 * up to each column. Columns of U, d and the gain (K over the residual's variance) are those after the channel; returns one over that
 * variance. */
TG_INLINE tg_real factor_measure(tg_real *u, tg_real *d, const tg_real *f, const tg_real *spread, int first, int rows, int stride, tg_real r,
                                 tg_real *gain)
{
    const int lanes = stride / TG_LANES;
    tg_lanes K[TG_MOST_LANES];
    for (int i = 0; i < lanes; i++) K[i] = lanes_all(0);
    tg_real variance = r, inverse = 1 / r;
    for (int k = first; k < rows; k++) {
        tg_real *const column = u + k * stride;
        const tg_real before = variance;
        const tg_lanes v = lanes_all(d[k] * f[k]), back = lanes_all(-f[k] * inverse);
        variance = r + spread[k];
        inverse = 1 / variance;
        d[k] *= before * inverse;
        for (int i = 0; i < lanes; i++) {
            const tg_lanes old = lanes_load(column + TG_LANES * i);
            lanes_store(column + TG_LANES * i, old + back * K[i]);
            K[i] += v * old;
        }
    }
    for (int i = 0; i < lanes; i++) lanes_store(gain + TG_LANES * i, K[i] * inverse);
    return inverse;
}
#endif
