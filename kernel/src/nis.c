/* Normalised innovation squared where one step has less noise than the filter counts: an input's error that neighbouring steps share adds
 * up over many of them as if each step had it whole, so the filter counts it whole; a single innovation contains only its own part (decision
 * 0096). */
#include "filter.h"

tg_real tgi_quadratic(int count, tg_real (*S)[TG_MAX_CHANNELS], tg_real *nu, const tg_real *least)
{
    tg_real sum = 0;
    for (int c = 0; c < count; c++) { /* S = L D L', solved as it is factored */
        const tg_real inverse = 1 / (S[c][c] > least[c] ? S[c][c] : least[c]);
        sum += nu[c] * nu[c] * inverse;
        for (int k = c + 1; k < count; k++) {
            const tg_real part = S[k][c] * inverse;
            nu[k] -= part * nu[c];
            for (int b = c + 1; b <= k; b++) S[k][b] -= part * S[b][c];
        }
    }
    return sum;
}

/* The part of residual b < c in residual c: the channel's row of H times b's gain. */
static tg_real coupling(const tgi_plan *plan, const tgi_result *result, int c, int b, int n)
{
    const tg_real *const gain = result->gain[b];
    tg_real sum = 0;
    if (result->channel[c] <= n) return gain[n + 1 + result->channel[c]];
    for (int i = 0; i <= n; i++) sum += plan->accelerometer[i] * gain[i];
    return sum;
}

tg_real tgi_nis(const tgi_plan *plan, const tgi_result *result, int n)
{
    tg_real T[TG_MAX_CHANNELS][TG_MAX_CHANNELS], S[TG_MAX_CHANNELS][TG_MAX_CHANNELS], nu[TG_MAX_CHANNELS], least[TG_MAX_CHANNELS];
    for (int c = 0; c < result->used; c++) {
        const int o = result->channel[c];
        nu[c] = result->innovation[o];
        least[c] = plan->r[o];
        T[c][c] = 1;
        for (int b = 0; b < c; b++) T[c][b] = coupling(plan, result, c, b, n);
        for (int b = 0; b <= c; b++) {
            S[c][b] = c == b && o <= n ? -plan->shared[o] : 0;
            for (int k = 0; k <= b; k++) S[c][b] += T[c][k] * T[b][k] * result->residual_variance[k];
        }
    }
    return tgi_quadratic(result->used, S, nu, least);
}
