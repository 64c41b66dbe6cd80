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
    tg_lanes part[TG_MOST_LANES];   /* that row's column of U */
} tgi_gram;

/* What column j of U keeps of the lane that row j is in, and the unit diagonal. */
static const tg_real TG_ABOVE[TG_LANES][2 * TG_LANES] = {
    {0, 0, 0, 0, 1, 0, 0, 0}, {1, 0, 0, 0, 0, 1, 0, 0}, {1, 1, 0, 0, 0, 0, 1, 0}, {1, 1, 1, 0, 0, 0, 0, 1}};

/* Take row j, which lies in the last of `lanes` lanes: project the row before off every column and divide row j's products with all rows
 * above it by its own. Gives column j of U and d_j. `joins`: the row has noise of its own. `first`: no row was taken before. */
TG_INLINE void factor_row(tgi_gram *g, int j, const int lanes, const int first, int joins, tg_real noise, tg_real *u, tg_real *d)
{
    const int stride = g->stride, chains = lanes > 2 ? 2 : 4; /* additions wait for each other; registers are few */
    const tg_lanes part_j = first ? lanes_all(0) : lanes_spread(g->part[lanes - 1], j % TG_LANES);
    tg_lanes sum[4][TG_MOST_LANES];
    const tg_real *const above = TG_ABOVE[j % TG_LANES];
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < lanes; i++) sum[c][i] = lanes_all(0);
    sum[0][lanes - 1] = lanes_mul(lanes_all(noise + TG_TINY), lanes_load(above + TG_LANES));
    if (!first && g->joins) { /* the last row's own column, just projected on itself */
        tg_real *const own = g->W + g->columns * stride;
        for (int i = 0; i < lanes; i++) lanes_store(own + TG_LANES * i, lanes_sub(lanes_all(0), g->part[i]));
        const tg_lanes v = lanes_mul(lanes_all(g->noise), part_j);
        for (int i = 0; i < lanes; i++) sum[chains - 1][i] = lanes_mul(v, g->part[i]);
    }
#define COLUMN(k, chain)                                                                                          \
    {                                                                                                             \
        tg_real *const w = g->W + (k) * stride;                                                                   \
        const tg_lanes taken = first ? lanes_all(0) : lanes_all(w[g->previous]);                                  \
        const tg_lanes own = first ? lanes_all(w[j]) : lanes_mul_sub(part_j, taken, lanes_all(w[j]));             \
        const tg_lanes v = lanes_mul(lanes_all(g->weight[k]), own);                                               \
        for (int i = 0; i < lanes; i++) {                                                                         \
            tg_lanes e = lanes_load(w + TG_LANES * i);                                                            \
            if (!first) e = lanes_mul_sub(g->part[i], taken, e);                                                  \
            if (!first) lanes_store(w + TG_LANES * i, e);                                                         \
            sum[(chain) % chains][i] = lanes_mul_add(v, e, sum[(chain) % chains][i]);                             \
        }                                                                                                         \
    }
    int k = 0;
    for (; k + 4 <= g->columns; k += 4) {
        COLUMN(k, 0)
        COLUMN(k + 1, 1)
        COLUMN(k + 2, 2)
        COLUMN(k + 3, 3)
    }
    if (k < g->columns) COLUMN(k, 0)
    if (k + 1 < g->columns) COLUMN(k + 1, 1)
    if (k + 2 < g->columns) COLUMN(k + 2, 2)
#undef COLUMN
    if (!first && g->joins) g->weight[g->columns++] = g->noise;
    for (int i = 0; i < lanes; i++) {
        sum[0][i] = lanes_add(sum[0][i], sum[1][i]);
        if (chains == 4) sum[0][i] = lanes_add(sum[0][i], lanes_add(sum[2][i], sum[3][i]));
    }
    const tg_lanes whole = lanes_spread(sum[0][lanes - 1], j % TG_LANES);
    const tg_lanes inverse = lanes_div(lanes_all(1), whole);
    for (int i = 0; i < lanes; i++) g->part[i] = lanes_mul(sum[0][i], inverse);
    for (int i = 0; i + 1 < lanes; i++) lanes_store(u + TG_LANES * i, g->part[i]);
    lanes_store(u + TG_LANES * (lanes - 1), lanes_mul_add(lanes_load(above), g->part[lanes - 1], lanes_load(above + TG_LANES)));
    for (int i = lanes; i < stride / TG_LANES; i++) lanes_store(u + TG_LANES * i, lanes_all(0));
    *d = lanes_at(whole, 0);
    g->joins = joins;
    g->noise = noise;
    g->previous = j;
}

/* Take row 0 after others: there is nothing above it. */
TG_INLINE void factor_last(const tgi_gram *g, tg_real noise, tg_real *u, tg_real *d)
{
    const tg_real part = lanes_at(g->part[0], 0);
    tg_real sum[4] = {noise + TG_TINY, g->joins ? g->noise * part * part : 0, 0, 0};
#define COLUMN(k, chain)                                                      \
    {                                                                         \
        const tg_real *const w = g->W + (k) * g->stride;                      \
        const tg_real left = w[0] - part * w[g->previous];                    \
        sum[chain] += g->weight[k] * left * left;                             \
    }
    int k = 0;
    for (; k + 4 <= g->columns; k += 4) {
        COLUMN(k, 0)
        COLUMN(k + 1, 1)
        COLUMN(k + 2, 2)
        COLUMN(k + 3, 3)
    }
    for (; k < g->columns; k++) COLUMN(k, 3)
#undef COLUMN
    *d = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    for (int i = 0; i < g->stride; i += TG_LANES) lanes_store(u + i, i ? lanes_all(0) : lanes_load(TG_ABOVE[0] + TG_LANES));
}

/* W and its weights, with nothing taken yet. Entries of a column beyond its last row, up to the whole lane, must be numbers. */
TG_INLINE tgi_gram factor_begin(tg_real *W, tg_real *weight, int columns, int stride)
{
    tgi_gram g;
    g.W = W;
    g.weight = weight;
    g.columns = columns;
    g.stride = stride;
    return g;
}

/* Measurement update by one channel (Bierman 1977, V.3; Thornton's gain). `f`: U'h, zero before column `first`; `spread`: sums of d f^2 up
 * to each column. Columns of U, d and the gain (K over the residual's variance) are those after the channel; returns one over that variance. */
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
            lanes_store(column + TG_LANES * i, lanes_mul_add(back, K[i], old));
            K[i] = lanes_mul_add(v, old, K[i]);
        }
    }
    for (int i = 0; i < lanes; i++) lanes_store(gain + TG_LANES * i, lanes_mul(K[i], lanes_all(inverse)));
    return inverse;
}
#endif
