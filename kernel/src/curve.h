/* Inside the online curve: a pair relative to the prototype curve, computed once for a wheel and for the vehicle. */
#ifndef TG_CURVE_H
#define TG_CURVE_H
#include "filter.h"

/* The prototype (paper eq. 8): g(s) = 1 - p e^(alpha_1 s) - (1 - p) e^(alpha_2 s), and k = -alpha_2 of its rise A (1 - exp(-k s)). */
#define TG_CURVE_SHARE ((tg_real)0.52)
#define TG_CURVE_SLOW ((tg_real)0.01)
#define TG_CURVE_RISE ((tg_real)-11.36)
#define TG_STEEPNESS (-TG_CURVE_RISE)

typedef struct {
    tg_real adhesion, height, slope; /* mu, g(s), |dg/ds| */
    tg_real variance, slip_variance, constant;
    tg_real radius, travel;          /* relative radius error; 1 - |s| */
    int32_t is_usable;
} tgi_observation;

tgi_observation tgi_observe(const tg_pair *p);
void tgi_curve_learn(tg_curve *c, tg_real dt, tg_real distance, int32_t pairs, const tgi_observation *observed, const tg_real *share);
#endif
