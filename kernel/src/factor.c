/* Between covariances and their factors P = U diag(d) U'. */
#include "factor.h"

/* Bierman 1977, III.4: upper triangular factors of a positive definite matrix, row-major with `rows` columns. */
tg_status tgi_factorise(int rows, int stride, const tg_real *P, tg_real *u, tg_real *d)
{
    tg_real A[TG_MAX_STATES][TG_MAX_STATES];
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < rows; j++) {
            A[i][j] = (P[i * rows + j] + P[j * rows + i]) / 2;
            if (!tgi_finite(A[i][j])) return TG_NOT_FINITE;
        }
    for (int j = rows - 1; j >= 0; j--) {
        if (!(A[j][j] > 0)) return TG_NOT_POSITIVE;
        d[j] = A[j][j];
        for (int i = 0; i < stride; i++) u[j * stride + i] = i < j ? A[i][j] / d[j] : i == j;
        for (int k = 0; k < j; k++)
            for (int i = 0; i <= k; i++) A[i][k] -= u[j * stride + i] * d[j] * u[j * stride + k];
    }
    return TG_OK;
}

/* P by rows of `stride`; only columns 0..i of row i hold, the others repeat them in part. */
void tgi_covariance(int rows, int stride, const tg_real *u, const tg_real *d, tg_real *P)
{
    const int lanes = stride / TG_LANES;
    for (int i = 0; i < rows; i++) { /* row i of P: sum over the columns that reach it */
        tg_lanes sum[TG_MOST_LANES];
        for (int l = 0; l < lanes; l++) sum[l] = lanes_all(0);
        for (int k = i; k < rows; k++) {
            const tg_lanes v = lanes_all(d[k] * u[k * stride + i]);
            for (int l = 0; l < lanes; l++) sum[l] += v * lanes_load(u + k * stride + TG_LANES * l);
        }
        for (int l = 0; l < lanes; l++) lanes_store(P + i * stride + TG_LANES * l, sum[l]);
    }
}

tg_status tgi_factors_of(const tg_filter *f, tg_real *u, tg_real *d)
{
    const int rows = f->states, stride = f->stride;
    if (!f->formed) {
        memcpy(u, f->u, (size_t)(rows * stride) * sizeof *u);
        memcpy(d, f->d, (size_t)rows * sizeof *d);
        return TG_OK;
    }
    tg_real P[TG_MAX_STATES * TG_MAX_STATES];
    for (int i = 0; i < rows; i++)
        for (int j = 0; j <= i; j++) P[i * rows + j] = P[j * rows + i] = f->P[i * stride + j];
    return tgi_factorise(rows, stride, P, u, d);
}

void tgi_covariance_of(const tg_filter *f, tg_real *P)
{
    if (f->formed)
        memcpy(P, f->P, (size_t)(f->states * f->stride) * sizeof *P);
    else
        tgi_covariance(f->states, f->stride, f->u, f->d, P);
}

tgi_gram tgi_factor_begin(tg_real *W, tg_real *weight, int columns, int stride)
{
    tgi_gram g;
    g.W = W;
    g.weight = weight;
    g.columns = columns;
    g.stride = stride;
    g.previous = g.joins = 0;
    g.noise = 0;
    for (int i = 0; i < TG_MOST_LANES; i++) g.part[i] = lanes_all(0);
    return g;
}

/* What column j of U keeps of the lane that row j is in, and the unit diagonal. */
static const tg_real ABOVE[TG_LANES][2 * TG_LANES] = {
    {0, 0, 0, 0, 1, 0, 0, 0}, {1, 0, 0, 0, 0, 1, 0, 0}, {1, 1, 0, 0, 0, 0, 1, 0}, {1, 1, 1, 0, 0, 0, 0, 1}};

/* Row j, which lies in the last of `lanes` lanes: a constant where this is inlined, so that the sums stay in registers. */
TG_INLINE void row_of_lanes(tgi_gram *g, int j, const int lanes, int joins, tg_real noise, tg_real *u, tg_real *d)
{
    const int stride = g->stride, columns = g->columns, previous = g->previous, chains = lanes > 2 ? 2 : 4; /* additions wait for each other */
    const tg_lanes part_j = lanes_all(lanes_at(g->part[lanes - 1], j % TG_LANES));
    tg_lanes part[TG_MOST_LANES], sum[4][TG_MOST_LANES];
    const tg_real *const above = ABOVE[j % TG_LANES];
    for (int i = 0; i < lanes; i++) part[i] = g->part[i];
    for (int c = 0; c < 4; c++)
        for (int i = 0; i < lanes; i++) sum[c][i] = lanes_all(0);
    sum[0][lanes - 1] = (noise + TG_TINY) * lanes_load(above + TG_LANES);
    if (g->joins) { /* the last row's own column, just projected on itself */
        tg_real *const own = g->W + columns * stride;
        for (int i = 0; i < lanes; i++) lanes_store(own + TG_LANES * i, lanes_all(0) - part[i]);
        const tg_lanes v = g->noise * part_j;
        for (int i = 0; i < lanes; i++) sum[chains - 1][i] = v * part[i];
    }
#define COLUMN(k, chain)                                                                              \
    {                                                                                                 \
        tg_real *const w = g->W + (k) * stride;                                                       \
        const tg_lanes taken = lanes_all(w[previous]);                                                \
        for (int i = 0; i < lanes; i++)                                                               \
            lanes_store(w + TG_LANES * i, lanes_load(w + TG_LANES * i) - part[i] * taken); \
        const tg_lanes v = lanes_all(g->weight[k] * w[j]);                                            \
        for (int i = 0; i < lanes; i++)                                                               \
            sum[(chain) % chains][i] += v * lanes_load(w + TG_LANES * i); \
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
    if (g->joins) g->weight[g->columns++] = g->noise;
    for (int i = 0; i < lanes; i++) {
        sum[0][i] += sum[1][i];
        if (chains == 4) sum[0][i] += sum[2][i] + sum[3][i];
    }
    const tg_lanes whole = lanes_all(lanes_at(sum[0][lanes - 1], j % TG_LANES));
    const tg_lanes inverse = lanes_all(1) / whole;
    for (int i = 0; i < lanes; i++) g->part[i] = sum[0][i] * inverse;
    for (int i = 0; i + 1 < lanes; i++) lanes_store(u + TG_LANES * i, g->part[i]);
    lanes_store(u + TG_LANES * (lanes - 1), lanes_load(above + TG_LANES) + lanes_load(above) * g->part[lanes - 1]);
    for (int i = lanes; i < stride / TG_LANES; i++) lanes_store(u + TG_LANES * i, lanes_all(0));
    *d = lanes_at(whole, 0);
    g->joins = joins;
    g->noise = noise;
    g->previous = j;
}

void tgi_factor_row(tgi_gram *g, int j, int joins, tg_real noise, tg_real *u, tg_real *d)
{
    switch (j / TG_LANES) {
    case 0: row_of_lanes(g, j, 1, joins, noise, u, d); break;
    case 1: row_of_lanes(g, j, 2, joins, noise, u, d); break;
    case 2: row_of_lanes(g, j, 3, joins, noise, u, d); break;
    case 3: row_of_lanes(g, j, 4, joins, noise, u, d); break;
    case 4: row_of_lanes(g, j, 5, joins, noise, u, d); break;
    case 5: row_of_lanes(g, j, 6, joins, noise, u, d); break;
    default: row_of_lanes(g, j, TG_MOST_LANES, joins, noise, u, d);
    }
}

void tgi_factor_last(const tgi_gram *g, tg_real noise, tg_real *u, tg_real *d)
{
    const tg_real part = lanes_at(g->part[0], 0);
    tg_real sum[4] = {noise + TG_TINY, g->joins ? g->noise * part * part : 0, 0, 0};
    for (int k = 0; k < g->columns; k++) {
        const tg_real *const w = g->W + k * g->stride;
        const tg_real left = w[0] - part * w[g->previous];
        sum[k < g->columns / 4 * 4 ? k % 4 : 3] += g->weight[k] * left * left;
    }
    *d = (sum[0] + sum[1]) + (sum[2] + sum[3]);
    for (int i = 0; i < g->stride; i += TG_LANES) lanes_store(u + i, i ? lanes_all(0) : lanes_load(ABOVE[0] + TG_LANES));
}
