/* Algebra of factors P = U diag(d) U' (docs/decisions/0001-ud-factors.md). Inlined, so that sizes are constants.
 *
 * Time update: P = W diag(weight) W' + diag(noise) is factored by modified weighted Gram-Schmidt (Thornton 1976; Bierman 1977, VI.4) on
 * the columns of [W | I], last row first. Every d is a sum of squares: it cannot become negative. A column of the identity is zero until
 * its row is taken, and joins the columns then. */
#ifndef TG_FACTOR_H
#define TG_FACTOR_H
#include "filter.h"

#define TG_MOST_LANES 7 /* 28 rows: 18 states and 10 channels */

/* Project the row taken before off every column (if `project`; `part` is its column of U), and gather row j's products with all rows. */
TG_INLINE void factor_sweep(tg_real *W, const tg_real *weight, int columns, int j, int lanes, int stride, int project, const tg_lanes *part,
                            tg_lanes *product)
{
    tg_lanes sum[4][TG_MOST_LANES]; /* four chains: additions wait for each other */
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < lanes; i++) sum[c][i] = lanes_all(0);
#define COLUMN(k, chain)                                                                \
    {                                                                                   \
        tg_real *const w = W + (k) * stride;                                            \
        tg_lanes e[TG_MOST_LANES];                                                      \
        if (project) {                                                                  \
            const tg_lanes taken = lanes_all(w[j + 1]);                                 \
            for (int i = 0; i < lanes; i++) {                                           \
                e[i] = lanes_mul_sub(part[i], taken, lanes_load(w + TG_LANES * i));     \
                lanes_store(w + TG_LANES * i, e[i]);                                    \
            }                                                                           \
        } else                                                                          \
            for (int i = 0; i < lanes; i++) e[i] = lanes_load(w + TG_LANES * i);        \
        const tg_lanes v = lanes_all(weight[k] * lanes_at(e[j / TG_LANES], j % TG_LANES)); \
        for (int i = 0; i < lanes; i++) sum[chain][i] = lanes_mul_add(v, e[i], sum[chain][i]); \
    }
    int k = 0;
    for (; k + 4 <= columns; k += 4) {
        COLUMN(k, 0)
        COLUMN(k + 1, 1)
        COLUMN(k + 2, 2)
        COLUMN(k + 3, 3)
    }
    if (k < columns) COLUMN(k, 0)
    if (k + 1 < columns) COLUMN(k + 1, 1)
    if (k + 2 < columns) COLUMN(k + 2, 2)
#undef COLUMN
    for (int i = 0; i < lanes; i++) product[i] = lanes_add(lanes_add(sum[0][i], sum[1][i]), lanes_add(sum[2][i], sum[3][i]));
}

/* Turn row j's products into column j of U and d_j, then project row j off the columns and gather for row j - 1. `noisy`: row j has noise
 * of its own, so one more column joins; returns the number of columns. */
TG_INLINE int factor_take(tg_real *W, tg_real *weight, int columns, int j, int noisy, tg_real noise, int stride, tg_real *u, tg_real *d,
                          tg_lanes *product)
{
    const int lanes = j / TG_LANES + 1, next = (j + TG_LANES - 1) / TG_LANES;
    const tg_real whole = lanes_at(product[j / TG_LANES], j % TG_LANES) + (noise + TG_TINY);
    const tg_lanes inverse = lanes_all(1 / whole);
    tg_lanes part[TG_MOST_LANES];
    for (int i = 0; i < lanes; i++) {
        part[i] = lanes_mul(product[i], inverse);
        lanes_store(u + TG_LANES * i, part[i]);
    }
    *d = whole;
    u[j] = 1;
    for (int i = j + 1; i < stride; i++) u[i] = 0;
    if (j == 0) return columns;
    factor_sweep(W, weight, columns, j - 1, next, stride, 1, part, product);
    if (!noisy) return columns;
    tg_real *const own = W + columns * stride;
    for (int i = 0; i < next; i++) lanes_store(own + TG_LANES * i, lanes_sub(lanes_all(0), part[i]));
    const tg_lanes v = lanes_all(noise * u[j - 1]);
    for (int i = 0; i < next; i++) product[i] = lanes_mul_add(v, part[i], product[i]);
    weight[columns] = noise;
    return columns + 1;
}

/* Measurement update by one channel (Bierman 1977, V.3; Thornton's gain). `f`: U'h, zero before column `first`. Columns of U, d and the
 * gain (K over the returned variance of the residual) are those after the channel. */
TG_INLINE tg_real factor_measure(tg_real *u, tg_real *d, const tg_real *f, int first, int rows, int stride, tg_real r, tg_real *gain)
{
    const int lanes = stride / TG_LANES;
    tg_lanes K[TG_MOST_LANES];
    for (int i = 0; i < lanes; i++) K[i] = lanes_all(0);
    tg_real variance = r, inverse = 1 / r;
    for (int k = first; k < rows; k++) {
        tg_real *const column = u + k * stride;
        const tg_real v = d[k] * f[k], before = variance;
        const tg_lanes back = lanes_all(-f[k] * inverse);
        variance += f[k] * v;
        inverse = 1 / variance;
        d[k] *= before * inverse;
        for (int i = 0; i < lanes; i++) {
            const tg_lanes old = lanes_load(column + TG_LANES * i);
            lanes_store(column + TG_LANES * i, lanes_mul_add(back, K[i], old));
            K[i] = lanes_mul_add(lanes_all(v), old, K[i]);
        }
    }
    for (int i = 0; i < lanes; i++) lanes_store(gain + TG_LANES * i, lanes_mul(K[i], lanes_all(inverse)));
    return variance;
}
#endif
