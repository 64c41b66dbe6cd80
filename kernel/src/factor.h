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
    tg_real noise;                  /* of the row taken last; 0: it brings no column */
    tg_lanes part[TG_MOST_LANES];   /* that row's column of U */
} tgi_gram;

/* Take row j, which lies in the last of `lanes` lanes: project the row before off every column and divide row j's products with all rows
 * above it by its own. Gives column j of U and d_j. */
TG_INLINE void factor_row(tgi_gram *g, int j, const int lanes, tg_real noise, tg_real *u, tg_real *d)
{
    const int stride = g->stride;
    tg_lanes sum[4][TG_MOST_LANES]; /* four chains: additions wait for each other */
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < lanes; i++) sum[c][i] = lanes_all(0);
    if (g->noise > 0) { /* the last row's own column, just projected on itself */
        tg_real *const own = g->W + g->columns * stride;
        for (int i = 0; i < lanes; i++) lanes_store(own + TG_LANES * i, lanes_sub(lanes_all(0), g->part[i]));
        const tg_lanes v = lanes_mul(lanes_all(g->noise), lanes_spread(g->part[lanes - 1], j % TG_LANES));
        for (int i = 0; i < lanes; i++) sum[3][i] = lanes_mul(v, g->part[i]);
    }
#define COLUMN(k, chain)                                                                            \
    {                                                                                               \
        tg_real *const w = g->W + (k) * stride;                                                     \
        const tg_lanes taken = lanes_all(w[g->previous]);                                           \
        tg_lanes e[TG_MOST_LANES];                                                                  \
        for (int i = 0; i < lanes; i++) {                                                           \
            e[i] = lanes_mul_sub(g->part[i], taken, lanes_load(w + TG_LANES * i));                  \
            lanes_store(w + TG_LANES * i, e[i]);                                                    \
        }                                                                                           \
        const tg_lanes v = lanes_mul(lanes_all(g->weight[k]), lanes_spread(e[lanes - 1], j % TG_LANES)); \
        for (int i = 0; i < lanes; i++) sum[chain][i] = lanes_mul_add(v, e[i], sum[chain][i]);       \
    }
    int k = 0;
    for (; k + 4 <= g->columns; k += 4) {
        COLUMN(k, 0)
        COLUMN(k + 1, 1)
        COLUMN(k + 2, 2)
        COLUMN(k + 3, 3)
    }
    for (; k < g->columns; k++) COLUMN(k, 0)
#undef COLUMN
    if (g->noise > 0) g->weight[g->columns++] = g->noise;
    for (int i = 0; i < lanes; i++) sum[0][i] = lanes_add(lanes_add(sum[0][i], sum[1][i]), lanes_add(sum[2][i], sum[3][i]));
    const tg_lanes whole = lanes_add(lanes_spread(sum[0][lanes - 1], j % TG_LANES), lanes_all(noise + TG_TINY));
    const tg_lanes inverse = lanes_div(lanes_all(1), whole);
    for (int i = 0; i < lanes; i++) {
        g->part[i] = lanes_mul(sum[0][i], inverse);
        lanes_store(u + TG_LANES * i, g->part[i]);
    }
    *d = lanes_at(whole, 0);
    g->noise = noise;
    g->previous = j;
    u[j] = 1;
    for (int i = j + 1; i < stride; i++) u[i] = 0;
}

/* W and its weights, with nothing taken yet. Column entries of row `rows` and below, up to the whole lane, must be numbers. */
TG_INLINE tgi_gram factor_begin(tg_real *W, tg_real *weight, int columns, int stride)
{
    tgi_gram g;
    g.W = W;
    g.weight = weight;
    g.columns = columns;
    g.stride = stride;
    g.previous = 0; /* nothing taken yet: project nothing off */
    g.noise = 0;
    for (int i = 0; i < stride / TG_LANES; i++) g.part[i] = lanes_all(0);
    return g;
}

/* Do `take(j, lanes)` from row `last` down to `first`; where `stride` is not the largest, lane counts are constants (up to 4). */
#define TG_LANES_DOWN(last, first, count, take) \
    for (int j = (last) < TG_LANES * (count) ? (last) : TG_LANES * (count) - 1; j >= (first) && j >= TG_LANES * ((count) - 1); j--) take(j, count)
#define TG_ROWS_DOWN(last, first, stride, take)                                   \
    if ((stride) >= TG_ROWS) {                                                    \
        for (int j = last; j >= (first); j--) take(j, j / TG_LANES + 1)           \
    } else {                                                                      \
        TG_LANES_DOWN(last, first, 4, take)                                       \
        TG_LANES_DOWN(last, first, 3, take)                                       \
        TG_LANES_DOWN(last, first, 2, take)                                       \
        TG_LANES_DOWN(last, first, 1, take)                                       \
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
