/* What a stiff chassis shifts between wheels (R; docs/decisions/0144). Loads that ground unevenness moves from wheel to wheel keep their sum and
 * both moments, so on the wheels they make a pattern that is neither alike, nor front against rear, nor left against right: one diagonal
 * against the other. Nothing on board measures it, and estimates take it for adhesion. True adhesions differ by axle and by side, hardly by
 * diagonal; so of that pattern only what lasts longer than unevenness does is taken for adhesion. */
#include "estimator.h"

#define TG_IN_LINE ((tg_real)1e-9) /* mean square below which a trend is none: all wheels on one axle, or on one side */

/* Trends over the driven wheels, orthonormal under their loads at rest (Gram and Schmidt). More wheels than trends leave patterns. */
void tgi_place_trends(const tg_settings *s, tgi_constants *c)
{
    const int32_t n = s->machine.wheels;
    tg_real weight[TG_MAX_WHEELS], whole = 0, longest = 0;
    int32_t found = 0, driven = 0;
    for (int32_t k = 0; k < s->axles; k++) longest = tgi_max(longest, tgi_fabs(s->load_transfer[k]));
    for (int32_t i = 0; i < n; i++) {
        driven += c->pulls[i] = s->driven[i] != 0;
        whole += weight[i] = s->driven[i] ? s->load_share[s->wheel_axle[i]] * s->wheel_share[i] : 0;
    }
    for (int32_t a = 0; a < TG_TRENDS && driven; a++) {
        tg_real *const trend = c->trend[found], square = 0;
        for (int32_t i = 0; i < n; i++) {
            const tg_real along = longest > 0 ? s->load_transfer[s->wheel_axle[i]] / longest : 0;
            trend[i] = a == 0 ? 1 : a == 1 ? along : (tg_real)c->side[i];
        }
        for (int32_t b = 0; b < found; b++) {
            tg_real share = 0;
            for (int32_t i = 0; i < n; i++) share += c->by_trend[b][i] * trend[i];
            for (int32_t i = 0; i < n; i++) trend[i] -= share * c->trend[b][i];
        }
        for (int32_t i = 0; i < n; i++) square += weight[i] / whole * tgi_square(trend[i]);
        for (int32_t i = 0; i < n; i++) {
            trend[i] *= square > TG_IN_LINE && s->driven[i] ? 1 / tgi_sqrt(square) : 0;
            c->by_trend[found][i] = weight[i] / whole * trend[i];
        }
        found += square > TG_IN_LINE;
    }
    c->warps = driven > found;
}

/* Of adhesions what no trend holds (n,). */
void tgi_warp(const tgi_constants *c, const tg_real *mu, int32_t n, tg_real *warp)
{
    tg_real share[TG_TRENDS] = {0};
    for (int32_t a = 0; a < TG_TRENDS; a++)
        for (int32_t i = 0; i < n; i++) share[a] += c->by_trend[a][i] * mu[i];
    for (int32_t i = 0; i < n; i++)
        warp[i] = c->pulls[i] ? mu[i] - share[0] * c->trend[0][i] - share[1] * c->trend[1][i] - share[2] * c->trend[2][i] : 0;
}
