/* From the belief over the state to what a user reads: slip, net traction, efficiency (physics.md 2), each with its spread. */
#include "estimator.h"

typedef struct { /* second moments of (omega_i, v, mu_i, rho_s): the filter's and the considered constants' */
    tg_real ww[8], wv[8], wm[8], wr[8], mm[8], mr[8], vm[8], vv, vr, rr;
} tgi_moments;

/* The filter's moments, and the sums over the columns of the products of their rows. */
TG_INLINE void gather(const tg_belief *b, const tg_real (*S)[TG_MAX_CONSIDERED], const int n, const int stride, tgi_moments *c)
{
    const int r = n, v = n + 1, w = n + 2, columns = b->columns;
    const tg_real *P = b->P, *Pr = P + r * stride, *Pv = P + v * stride;
    const tg_lanes none = lanes_all(0);
    tg_lanes rr = none, vr = none, vv = none;
    for (int i = 0; i < n; i++) {
        const tg_real *Pw = P + (w + i) * stride;
        tg_lanes mm = none, mr = none, vm = none, wm = none, wr = none, wv = none, ww = none;
        for (int k = 0; k < columns; k += TG_LANES) {
            const tg_lanes sm = lanes_load(S[i] + k), sw = lanes_load(S[w + i] + k), sr = lanes_load(S[r] + k), sv = lanes_load(S[v] + k);
            mm += sm * sm;
            mr += sm * sr;
            vm += sm * sv;
            wm += sm * sw;
            wr += sw * sr;
            wv += sw * sv;
            ww += sw * sw;
        }
        c->mm[i] = P[i * stride + i] + lanes_sum(mm);
        c->mr[i] = Pr[i] + lanes_sum(mr);
        c->vm[i] = Pv[i] + lanes_sum(vm);
        c->wm[i] = Pw[i] + lanes_sum(wm);
        c->wr[i] = Pw[r] + lanes_sum(wr);
        c->wv[i] = Pw[v] + lanes_sum(wv);
        c->ww[i] = Pw[w + i] + lanes_sum(ww);
    }
    for (int k = 0; k < columns; k += TG_LANES) {
        const tg_lanes sr = lanes_load(S[r] + k), sv = lanes_load(S[v] + k);
        rr += sr * sr;
        vr += sv * sr;
        vv += sv * sv;
    }
    c->rr = Pr[r] + lanes_sum(rr);
    c->vr = Pv[r] + lanes_sum(vr);
    c->vv = Pv[v] + lanes_sum(vv);
}

/* Uneven ground (roughness.c): bumps hold the wheels back, and the wheels' loads come and go unseen. The ground speed may be off for
 * long (slow_speed.c). */
TG_INLINE void roughen(tgi_moments *c, const tg_real *x, const tgi_scene *scene, const int n)
{
    c->rr += scene->bumps + scene->unseen_grade;
    c->vv = tgi_max(c->vv, scene->reckoned) + scene->slow_speed + scene->disputed + scene->late;
    for (int i = 0; i < n; i++) c->mm[i] += tgi_rough_adhesion(scene, x[i]) + scene->chatter[i];
}

/* Slip is within [-1, 1], so a spread above 1 means no more than 1; likewise of the efficiency. */
TG_INLINE tg_real bounded_root(tg_real variance) { return tgi_root(variance < 1 ? variance : 1); }

/* Of a normal value only what is above 0 counts, as of a net traction for the efficiency: the mean square by which it may then differ from
 * that of the mean, over the value's variance. */
static tg_real above_zero(tg_real mean, tg_real sd)
{
    if (mean >= 4 * sd) return 1; /* within 1e-4 */
    if (mean <= -4 * sd) return 0;
    const tg_real x = mean / sd, above = tgi_erfc(-x * (tg_real)0.70710678) / 2, density = tgi_exp(-x * x / 2) * (tg_real)0.39894228;
    return x < 0 ? tgi_max((1 + x * x) * above + x * density, 0) : above - x * density + x * x * (1 - above);
}

/* Net traction (paper eq. 5), slip and efficiency (paper eq. 7) of all wheels, delta method. `mean` is the mean adhesion over the load:
 * what a common radius error does to rho_s. */
TG_INLINE void traction(const tg_settings *restrict s, const tg_real *restrict x, const tgi_moments *restrict c, const tgi_scene *restrict scene,
                        tg_real mean, tg_real *restrict o, const int n)
{
    const tg_real rho = x[n], v = x[n + 1], error = s->uncertainty.wheel_radius;
    const tg_real tire = s->machine.tire_rolling_resistance, least = (tg_real)0.02;
    for (int i = 0; i < n; i++) {
        const tg_real mu = x[i], kappa = mu - rho;
        o[TG_OUT_WHEEL_SPEED + i] = x[n + 2 + i];
        o[TG_OUT_WHEEL_SPEED_STD + i] = tgi_root(c->ww[i]);
        o[TG_OUT_ADHESION + i] = mu;
        o[TG_OUT_ADHESION_STD + i] = tgi_root(c->mm[i] + tgi_square(mu * error));
        o[TG_OUT_NET_TRACTION + i] = kappa;
        o[TG_OUT_NET_TRACTION_STD + i] = tgi_root(c->mm[i] - 2 * c->mr[i] + c->rr + tgi_square((mu - mean) * error));
    }
    for (int i = 0; i < n; i++) {
        const tgi_slip g = tgi_slip_of(x[n + 2 + i], tgi_hub_of(v + scene->hub[i], scene->across[i]), s->rolling_radius[i], s->standstill_speed);
        const tg_real slip_variance = g.wheel * (g.wheel * c->ww[i] + 2 * g.ground * c->wv[i]) + g.ground * g.ground * c->vv + scene->turn[i];
        o[TG_OUT_SLIP + i] = g.slip;
        o[TG_OUT_SLIP_STD + i] = bounded_root(slip_variance + tgi_square(g.radius * error));

        const tg_real mu = x[i], gross = mu + tire, kappa = mu - rho, pull = kappa > 0 ? kappa : 0, travel = 1 - g.slip;
        const tg_real inverse = 1 / (gross > least ? gross : least), share = pull * inverse;
        const tg_real by_mu = (1 - share) * inverse * travel, by_rho = -inverse * travel;
        const tg_real by_wheel = -share * g.wheel, by_ground = -share * g.ground;
        const tg_real cross = c->wm[i] * by_mu + c->wr[i] * by_rho, cross_v = c->vm[i] * by_mu + c->vr * by_rho;
        const tg_real by_radius = -share * g.radius - by_mu * mu - by_rho * mean;
        const tg_real variance = share * share * slip_variance + 2 * (by_wheel * cross + by_ground * cross_v)
                               + by_mu * (by_mu * c->mm[i] + 2 * by_rho * c->mr[i]) + by_rho * by_rho * c->rr + tgi_square(by_radius * error);
        o[TG_OUT_EFFICIENCY + i] = gross > 0 ? share * travel : 0;
        o[TG_OUT_EFFICIENCY_STD + i] = bounded_root(variance * above_zero(kappa, o[TG_OUT_NET_TRACTION_STD + i]));
    }
    o[TG_OUT_GROUND_SPEED] = v;
    o[TG_OUT_GROUND_SPEED_STD] = tgi_root(c->vv);
    o[TG_OUT_SOIL_RESISTANCE] = rho;
    o[TG_OUT_SOIL_RESISTANCE_STD] = tgi_root(c->rr + tgi_square(mean * error));
}

static void blank(tg_real *out, int32_t place, int32_t n)
{
    for (int32_t i = 0; i < n; i++) out[place + i] = (tg_real)NAN;
}

/* What is not known: slip and efficiency at standstill, and they and the speeds before anything was measured. */
static void leave_open(const tgi_scene *scene, int32_t n, tg_real *o)
{
    const int32_t undefined[] = {TG_OUT_SLIP, TG_OUT_SLIP_STD, TG_OUT_EFFICIENCY, TG_OUT_EFFICIENCY_STD};
    for (int32_t k = 0; k < 4; k++) blank(o, undefined[k], n);
    if (scene->seen_motion > 0) return;
    blank(o, TG_OUT_GROUND_SPEED, 2);
    blank(o, TG_OUT_WHEEL_SPEED, n);
    blank(o, TG_OUT_WHEEL_SPEED_STD, n);
}

/* Of what only all wheels' speeds and torques tell, nothing while one of them is silent. */
static void leave_unknown(const tgi_scene *scene, int32_t n, tg_real *o)
{
    const int32_t undefined[] = {TG_OUT_ADHESION, TG_OUT_ADHESION_STD, TG_OUT_NET_TRACTION, TG_OUT_NET_TRACTION_STD, TG_OUT_EFFICIENCY, TG_OUT_EFFICIENCY_STD};
    for (int32_t k = 0; k < 6; k++) blank(o, undefined[k], n);
    blank(o, TG_OUT_SOIL_RESISTANCE, 2);
    for (int32_t i = 0; i < n; i++)
        if (scene->silent[i] > 1) o[TG_OUT_SLIP + i] = o[TG_OUT_SLIP_STD + i] = o[TG_OUT_WHEEL_SPEED + i] = o[TG_OUT_WHEEL_SPEED_STD + i] = (tg_real)NAN;
}

/* All values that follow from the belief; in place of `warp`, what its adhesions are beyond all trends, they have the scene's (warp.c).
 * Speeds get back the vehicle's own signs; mu, rho_s, slip and kappa stay in the direction of travel. */
void tgi_traction(const tg_settings *restrict s, const tg_real *restrict warp, const tg_belief *restrict b, const tg_real (*restrict S)[TG_MAX_CONSIDERED],
                  const tgi_scene *restrict scene, tg_real *restrict o)
{
    const int32_t n = s->machine.wheels;
    tg_real thrust = 0, x[TG_ROWS];
    tgi_moments c;
    for (int32_t i = 0; i < n; i++) thrust += b->x[i] * scene->load[i];
    thrust /= scene->weight;
    gather(b, S, n, tgi_stride(n), &c);
    memcpy(x, b->x, sizeof x);
    for (int32_t i = 0; i < n; i++) x[i] += scene->warp[i] - warp[i];
    roughen(&c, x, scene, n);
    traction(s, x, &c, scene, thrust, o, n);
    if (scene->direction < 0) {
        o[TG_OUT_GROUND_SPEED] = -o[TG_OUT_GROUND_SPEED];
        for (int32_t i = 0; i < n; i++) o[TG_OUT_WHEEL_SPEED + i] = -o[TG_OUT_WHEEL_SPEED + i];
    }
    if (scene->any_silent > 0) leave_unknown(scene, n, o);
    if (scene->standing > 0 || !(scene->seen_motion > 0)) leave_open(scene, n, o);
}
