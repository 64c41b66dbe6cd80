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
            for (int l = 0; l < lanes; l++) sum[l] = lanes_mul_add(v, lanes_load(u + k * stride + TG_LANES * l), sum[l]);
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
