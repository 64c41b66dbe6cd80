/* From the belief over the state to what a user reads: slip, net traction, efficiency (physics.md 2), each with its spread. */
#include "estimator.h"

typedef struct { /* second moments of (omega, v, mu, rho_s) of four wheels: the filter's and the considered constants' */
    tg_lanes ww, wv, wm, wr, mm, mr, vm;
} tgi_moments;

typedef struct { /* those of v and rho_s */
    tg_real vv, vr, rr;
} tgi_common;

TG_INLINE tg_lanes every(const tg_real *p, int step) { return lanes_of(p[0], p[step], p[2 * step], p[3 * step]); }

/* Of four wheels, the products of rows a, a + 1, ... with rows b, b + step, ..., summed over the columns. */
TG_INLINE tg_lanes products(const tg_real (*S)[TG_MAX_CONSIDERED], int a, int b, int step, int columns)
{
    tg_lanes sum[TG_LANES] = {lanes_all(0), lanes_all(0), lanes_all(0), lanes_all(0)};
    for (int k = 0; k < columns; k += TG_LANES)
        for (int i = 0; i < TG_LANES; i++) sum[i] += lanes_load(S[a + i] + k) * lanes_load(S[b + step * i] + k);
    return lanes_sums(sum);
}

/* Of wheels i to i + 3; lanes behind the last wheel hold what nothing uses. Uneven ground (roughness.c): the wheels' loads come and go
 * unseen. */
TG_INLINE tgi_moments moments_of(const tg_belief *b, const tg_real (*S)[TG_MAX_CONSIDERED], const tgi_scene *scene, tg_lanes mu, const int n, const int stride, int i)
{
    const int r = n, v = n + 1, w = n + 2 + i, columns = b->columns;
    const tg_real *const P = b->P, *const Pw = P + w * stride;
    tgi_moments c;
    c.mm = every(P + i * (stride + 1), stride + 1) + products(S, i, i, 1, columns) + (scene->unseen_load * (mu * mu) + lanes_load(scene->doubt + i) + lanes_load(scene->sides + i));
    c.mr = lanes_load(P + r * stride + i) + products(S, i, r, 0, columns);
    c.vm = lanes_load(P + v * stride + i) + products(S, i, v, 0, columns);
    c.wm = every(Pw + i, stride + 1) + products(S, w, i, 1, columns);
    c.wr = every(Pw + r, stride) + products(S, w, r, 0, columns);
    c.wv = every(Pw + v, stride) + products(S, w, v, 0, columns);
    c.ww = every(Pw + w, stride + 1) + products(S, w, w, 1, columns) + lanes_load(scene->since_sample + i);
    return c;
}

/* Bumps hold the wheels back. The ground speed may be off for long (slow_speed.c). */
TG_INLINE tgi_common common_of(const tg_belief *b, const tg_real (*S)[TG_MAX_CONSIDERED], const tgi_scene *scene, const int n, const int stride)
{
    const int r = n, v = n + 1, columns = b->columns;
    const tg_real *const Pr = b->P + r * stride, *const Pv = b->P + v * stride;
    const tg_lanes by_r = products(S, r, r, 0, columns), by_v = products(S, r, v, 0, columns);
    const tgi_common c = {tgi_max(Pv[v] + by_v[1], scene->reckoned) + scene->slow_speed + scene->disputed + scene->late + scene->astray, Pv[r] + by_v[0],
                          Pr[r] + by_r[0] + (scene->bumps + scene->unseen_grade)};
    return c;
}

/* SD; slip is within [-1, 1], so a spread above 1 means no more than 1; likewise of the efficiency. */
TG_INLINE tg_lanes root(tg_lanes variance) { return lanes_sqrt(lanes_max(variance, lanes_all(0))); }
TG_INLINE tg_lanes bounded_root(tg_lanes variance) { return root(lanes_min(variance, lanes_all(1))); }

/* Of a normal value only what is above 0 counts, as of a net traction for the efficiency: the mean square by which it may then differ from
 * that of the mean, over the value's variance. */
static tg_real above_zero(tg_real mean, tg_real sd)
{
    if (mean >= 4 * sd) return 1; /* within 1e-4 */
    if (mean <= -4 * sd) return 0;
    const tg_real x = mean / sd, above = tgi_erfc(-x * (tg_real)0.70710678) / 2, density = tgi_exp(-x * x / 2) * (tg_real)0.39894228;
    return x < 0 ? tgi_max((1 + x * x) * above + x * density, 0) : above - x * density + x * x * (1 - above);
}

/* Net traction (paper eq. 5), slip and efficiency (paper eq. 7) of wheels i to i + 3 with adhesions `mu`, delta method. `mean` is the mean
 * adhesion over the load: what a common radius error does to rho_s. */
TG_INLINE void traction(const tg_settings *s, const tg_real *x, tg_lanes mu, const tgi_moments *c, const tgi_common *all, const tgi_scene *scene,
                        tg_real mean, tg_real *o, const int n, int i)
{
    const tg_real rho = x[n], v = x[n + 1], error = s->uncertainty.wheel_radius, least = (tg_real)0.02;
    const tg_lanes none = lanes_all(0), omega = lanes_load(x + n + 2 + i), kappa = mu - rho;
    const tg_lanes by_mean = (mu - mean) * error, net = root(c->mm - 2 * c->mr + all->rr + by_mean * by_mean);
    lanes_store(o + TG_OUT_WHEEL_SPEED + i, omega);
    lanes_store(o + TG_OUT_WHEEL_SPEED_STD + i, root(c->ww));
    lanes_store(o + TG_OUT_ADHESION + i, mu);
    lanes_store(o + TG_OUT_ADHESION_STD + i, root(c->mm + mu * error * (mu * error)));
    lanes_store(o + TG_OUT_NET_TRACTION + i, kappa);
    lanes_store(o + TG_OUT_NET_TRACTION_STD + i, net);

    const tgi_slip g = tgi_slip_of(omega, tgi_hub_of(v + lanes_load(scene->hub + i), lanes_load(scene->across + i)),
                                   lanes_load(s->rolling_radius + i), s->standstill_speed);
    const tg_lanes slip_variance = g.wheel * (g.wheel * c->ww + 2 * g.ground * c->wv) + g.ground * g.ground * all->vv
                                 + lanes_load(scene->turn + i);
    lanes_store(o + TG_OUT_SLIP + i, g.slip);
    lanes_store(o + TG_OUT_SLIP_STD + i, bounded_root(slip_variance + g.radius * error * (g.radius * error)));

    const tg_lanes gross = mu + s->machine.tire_rolling_resistance, travel = 1 - g.slip;
    const tg_lanes inverse = 1 / lanes_max(gross, lanes_all(least)), share = lanes_max(kappa, none) * inverse;
    const tg_lanes by_mu = (1 - share) * inverse * travel, by_rho = -inverse * travel;
    const tg_lanes by_wheel = -share * g.wheel, by_ground = -share * g.ground;
    const tg_lanes cross = c->wm * by_mu + c->wr * by_rho, cross_v = c->vm * by_mu + all->vr * by_rho;
    const tg_lanes by_radius = -share * g.radius - by_mu * mu - by_rho * mean;
    const tg_lanes variance = share * share * slip_variance + 2 * (by_wheel * cross + by_ground * cross_v)
                            + by_mu * (by_mu * c->mm + 2 * by_rho * c->mr) + by_rho * by_rho * all->rr + by_radius * error * (by_radius * error);
    tg_lanes above;
    for (int k = 0; k < TG_LANES; k++) above[k] = i + k < n ? above_zero(kappa[k], net[k]) : 0;
    lanes_store(o + TG_OUT_EFFICIENCY + i, lanes_where((tg_choice)(gross > none), share * travel, none));
    lanes_store(o + TG_OUT_EFFICIENCY_STD + i, bounded_root(variance * above));
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
    const int32_t n = s->machine.wheels, stride = tgi_stride(n);
    const tgi_common c = common_of(b, S, scene, n, stride);
    tg_real thrust = 0;
    for (int32_t i = 0; i < n; i++) thrust += b->x[i] * scene->load[i];
    thrust /= scene->weight;
    for (int32_t i = 0; i < n; i += TG_LANES) {
        const tg_lanes mu = lanes_load(b->x + i) + (lanes_load(scene->warp + i) - lanes_load(warp + i));
        const tgi_moments m = moments_of(b, S, scene, mu, n, stride, i);
        traction(s, b->x, mu, &m, &c, scene, thrust, o, n, i);
    }
    for (int32_t place = TG_OUT_WHEEL_SPEED; place < TG_OUT_VERTICAL_LOAD; place += TG_MAX_WHEELS) /* of whole lanes, what is no wheel's */
        for (int32_t i = n; i % TG_LANES; i++) o[place + i] = (tg_real)NAN;
    o[TG_OUT_GROUND_SPEED] = b->x[n + 1];
    o[TG_OUT_GROUND_SPEED_STD] = tgi_root(c.vv);
    o[TG_OUT_SOIL_RESISTANCE] = b->x[n];
    o[TG_OUT_SOIL_RESISTANCE_STD] = tgi_root(c.rr + tgi_square(thrust * s->uncertainty.wheel_radius));
    if (scene->direction < 0) {
        o[TG_OUT_GROUND_SPEED] = -o[TG_OUT_GROUND_SPEED];
        for (int32_t i = 0; i < n; i++) o[TG_OUT_WHEEL_SPEED + i] = -o[TG_OUT_WHEEL_SPEED + i];
    }
    if (scene->any_silent > 0) leave_unknown(scene, n, o);
    if (scene->standing > 0 || !(scene->seen_motion > 0)) leave_open(scene, n, o);
}
