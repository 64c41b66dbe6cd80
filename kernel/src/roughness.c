/* Rough ground, as the estimated soil resistance shows it. The body pitches over it, which the accelerometer and the pitch sensor take for
 * a slope, and load moves between the wheels: the forces see soil resistance come and go faster than soil does (R). What it wanders
 * within TG_ROUGH_LAG counts as uncertainty. */
#include "estimator.h"

#define TG_ROUGH_LAG ((tg_real)0.4) /* s: soil itself takes longer to change under a vehicle's length */
#define TG_ROUGH_MEMORY 1 /* s */

/* After a row's estimate. `flowing`: the row goes on from the one before it. */
void tgi_watch_roughness(tg_estimator *e, int32_t flowing, tg_real dt)
{
    tgi_roughness *r = &e->roughness;
    const tg_real rho = e->belief.x[e->settings.machine.wheels];
    if (!flowing) r->slow = rho;
    r->slow += dt / (TG_ROUGH_LAG + dt) * (rho - r->slow);
    r->square += dt / (TG_ROUGH_MEMORY + dt) * (tgi_square(rho - r->slow) - r->square);
}
