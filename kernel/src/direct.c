/* The exact step on the covariance itself: a third of the work of factors, but with subtraction. Sound where a bound on the result holds
 * (docs/decisions/0001-ud-factors.md); elsewhere the caller uses factors. Up to four wheels, double precision. */
#include "direct.h"

#if TGI_DIRECT

typedef struct { /* the map, in lanes */
    tg_lanes phi, b, c;
    tg_real g;
} map;

/* What belongs to the wheels; 0 beyond the last. */
TG_INLINE tg_lanes load_wheels(const tg_real *p, const int n)
{
    return n == TG_LANES ? lanes_load(p) : lanes_of(p[0], n > 1 ? p[1] : 0, n > 2 ? p[2] : 0, 0);
}

TG_INLINE void load_rows(const tg_real *P, tgi_block *k, const int n, const int stride)
{
    const tg_real *const rho = P + n * stride, *const v = rho + stride;
    for (int i = 0; i < n; i++) {
        const tg_real *const omega = v + (1 + i) * stride;
        k->mu[i] = load_wheels(P + i * stride, n);
        k->omega_mu[i] = load_wheels(omega, n);
        k->omega_rest[i] = lanes_of(omega[n], omega[n + 1], 0, 0);
        k->omega[i] = load_wheels(omega + n + 2, n);
    }
    k->rho_mu = load_wheels(rho, n);
    k->rho_rest = lanes_of(rho[n], rho[n + 1], 0, 0);
    k->rho_omega = load_wheels(rho + n + 2, n);
    k->v_mu = load_wheels(v, n);
    k->v_rest = lanes_of(v[n], v[n + 1], 0, 0);
    k->v_omega = load_wheels(v + n + 2, n);
}

/* Row i of the transposed 4 x 4 block. */
TG_INLINE void transpose(const tg_lanes *a, tg_lanes *to, const int n)
{
    for (int i = 0; i < n; i++)
        to[i] = lanes_of(lanes_at(a[0], i), n > 1 ? lanes_at(a[n > 1 ? 1 : 0], i) : 0, n > 2 ? lanes_at(a[n > 2 ? 2 : 0], i) : 0,
                         n > 3 ? lanes_at(a[n > 3 ? 3 : 0], i) : 0);
}

TG_INLINE tg_lanes unit(int i) { return lanes_of(i == 0, i == 1, i == 2, i == 3); }

/* F P F' + Q. Products that appear twice in the covariance are rounded alike: it stays symmetric to the bit. */
TG_INLINE void block_predict(const map *m, const tg_real *q, const tgi_block *P, tgi_block *to, const int n)
{
    const tg_lanes g = lanes_all(m->g);
    tg_lanes Y[TG_LANES], pull = P->v_mu, wheels = P->v_omega; /* Y: mu by omega */
    transpose(P->omega_mu, Y, n);
    for (int i = 0; i < n; i++) {
        const tg_lanes c = lanes_all(lanes_at(m->c, i));
        pull += c * P->mu[i];
        wheels += c * Y[i];
    }
    const tg_lanes v_mu = pull - g * P->rho_mu, v_old_omega = wheels - g * P->rho_omega;
    const tg_lanes v_omega = m->phi * v_old_omega + m->b * v_mu;
    const tg_lanes rho_omega = m->phi * P->rho_omega + m->b * P->rho_mu;
    const tg_real rho = lanes_at(P->rho_rest, 0), v_rho = lanes_at(P->v_rest, 0);
    const tg_real cross = (v_rho - m->g * rho) + lanes_sum(m->c * P->rho_mu);
    const tg_real v = (lanes_at(P->v_rest, 1) - m->g * (v_rho + cross)) + lanes_sum(m->c * (P->v_mu + v_mu));
    for (int j = 0; j < n; j++) {
        const tg_lanes phi = lanes_all(lanes_at(m->phi, j)), b = lanes_all(lanes_at(m->b, j));
        const tg_lanes mixed = b * m->phi * Y[j] + phi * m->b * P->omega_mu[j];
        const tg_lanes own = phi * m->phi * P->omega[j] + b * m->b * P->mu[j];
        to->omega[j] = own + mixed + q[n + 2 + j] * unit(j);
        to->omega_mu[j] = phi * P->omega_mu[j] + b * P->mu[j];
        to->omega_rest[j] = lanes_of(lanes_at(rho_omega, j), lanes_at(v_omega, j), 0, 0);
        to->mu[j] = P->mu[j] + q[j] * unit(j);
    }
    to->rho_mu = P->rho_mu;
    to->rho_rest = lanes_of(rho + q[n], cross, 0, 0);
    to->rho_omega = rho_omega;
    to->v_mu = v_mu;
    to->v_rest = lanes_of(cross, v + q[n + 1], 0, 0);
    to->v_omega = v_omega;
}

/* The first half of the bound: every state's noise is a share of its variance. False for what is no number, too. */
TG_INLINE int noise_holds(const tg_real *q, const tgi_block *P, const int n)
{
    int holds = q[n] >= TGI_NOISE_SHARE * lanes_at(P->rho_rest, 0);
    holds &= q[n + 1] >= TGI_NOISE_SHARE * lanes_at(P->v_rest, 1);
    for (int i = 0; i < n; i++) {
        holds &= q[i] >= TGI_NOISE_SHARE * lanes_at(P->mu[i], i);
        holds &= q[n + 2 + i] >= TGI_NOISE_SHARE * lanes_at(P->omega[i], i);
    }
    return holds;
}

/* P less h h' inverse; K = h inverse. */
TG_INLINE void block_update(tgi_block *P, const tgi_gain *h, tg_real one_over, tgi_gain *K, const int n)
{
    const tg_lanes inverse = lanes_all(one_over), h_rho = lanes_all(lanes_at(h->rest, 0)), h_v = lanes_all(lanes_at(h->rest, 1));
    K->mu = h->mu * inverse;
    K->rest = h->rest * inverse;
    K->omega = h->omega * inverse;
    for (int i = 0; i < n; i++) {
        const tg_lanes mu = lanes_all(lanes_at(h->mu, i)), omega = lanes_all(lanes_at(h->omega, i)), k = lanes_all(lanes_at(K->omega, i));
        P->mu[i] -= mu * h->mu * inverse;
        P->omega[i] -= omega * h->omega * inverse;
        P->omega_mu[i] -= omega * K->mu;
        P->omega_rest[i] -= k * h->rest;
    }
    P->rho_mu -= h_rho * K->mu;
    P->rho_rest -= h_rho * h->rest * inverse;
    P->rho_omega -= h_rho * K->omega;
    P->v_mu -= h_v * K->mu;
    P->v_rest -= h_v * h->rest * inverse;
    P->v_omega -= h_v * K->omega;
}

typedef struct { /* the step on its way */
    tgi_direct *out;
    tg_real r[TG_LANES + 2]; /* weighted */
    tg_real noise; /* their product: the second half of the bound */
} channel_updates;

/* The innovation of a channel before any update, and its weight. */
TG_INLINE void expect(const tg_filter *f, const tgi_plan *plan, channel_updates *t, int o, tg_real innovation, tg_real product)
{
    tgi_result *const result = t->out->result;
    const tg_real variance = product + plan->r[o], weight = tgi_weight(f->tuning.huber, innovation, variance);
    result->innovation[o] = innovation;
    result->variance[o] = variance;
    result->weight[o] = weight;
    t->r[o] = weight < 1 ? plan->r[o] / weight : plan->r[o];
}

/* One channel with h = P H' and the residual after the channels before it. */
TG_INLINE void update_channel(channel_updates *t, int o, const tgi_gain *h, tg_real product, tg_real residual, const int n)
{
    tgi_direct *const out = t->out;
    const tg_real r = t->r[o], S = product + r, inverse = 1 / S;
    tgi_gain *const K = &out->gain[out->used];
    block_update(&out->P, h, inverse, K, n);
    const tg_lanes nu = lanes_all(residual);
    out->x.mu += nu * K->mu;
    out->x.rest += nu * K->rest;
    out->x.omega += nu * K->omega;
    tgi_result *const result = out->result;
    result->channel[out->used] = o;
    result->residual[out->used] = residual;
    result->residual_variance[out->used] = S;
    result->square += residual * residual * inverse;
    result->volume *= S;
    t->noise *= r;
    out->used++;
}

TG_INLINE tg_real dot(tg_lanes a, tg_lanes b) { return lanes_sum(a * b); }

typedef struct { /* covariance of a_x with mu, rho_s, v and omega, and its own */
    tg_lanes mu, omega;
    tg_real rho, v, own;
} shock;

TG_INLINE shock shock_of(const tgi_block *P, tg_lanes a, tg_real a_rho, const int n)
{
    const tg_lanes weight = lanes_all(a_rho);
    shock s;
    tg_lanes Y[TG_LANES];
    transpose(P->omega_mu, Y, n);
    s.mu = weight * P->rho_mu;
    s.omega = weight * P->rho_omega;
    for (int i = 0; i < n; i++) {
        const tg_lanes own = lanes_all(lanes_at(a, i));
        s.mu += own * P->mu[i];
        s.omega += own * Y[i];
    }
    const tg_lanes rest = lanes_of(dot(a, P->rho_mu), dot(a, P->v_mu), 0, 0) + weight * P->rho_rest;
    s.rho = lanes_at(rest, 0);
    s.v = lanes_at(rest, 1);
    s.own = dot(a, s.mu) + a_rho * s.rho;
    return s;
}

/* Channels in the order of the other engine: omega_n..omega_1, v, a_x. */
TG_INLINE void update_channels(const tg_filter *f, const tgi_plan *plan, channel_updates *t, const int n)
{
    tgi_direct *const out = t->out;
    tgi_block *const P = &out->P;
    const tg_lanes a = load_wheels(plan->accelerometer, n);
    const tg_real a_rho = plan->accelerometer[n];
    shock s = {lanes_all(0), lanes_all(0), 0, 0, 0};
    for (int i = 0; i < n; i++)
        if (plan->present[1 + i]) expect(f, plan, t, 1 + i, plan->y[1 + i] - lanes_at(out->x.omega, i), lanes_at(P->omega[i], i));
    if (plan->present[0]) expect(f, plan, t, 0, plan->y[0] - lanes_at(out->x.rest, 1), lanes_at(P->v_rest, 1));
    if (plan->present[n + 1]) {
        s = shock_of(P, a, a_rho, n);
        expect(f, plan, t, n + 1, plan->y[n + 1] - plan->accelerometer_shift - (dot(a, out->x.mu) + a_rho * lanes_at(out->x.rest, 0)), s.own);
    }
    for (int j = n - 1; j >= 0; j--) {
        if (!plan->present[1 + j]) continue;
        const tgi_gain h = {P->omega_mu[j], P->omega_rest[j], P->omega[j]};
        update_channel(t, 1 + j, &h, lanes_at(h.omega, j), plan->y[1 + j] - lanes_at(out->x.omega, j), n);
    }
    if (plan->present[0]) {
        const tgi_gain h = {P->v_mu, P->v_rest, P->v_omega};
        update_channel(t, 0, &h, lanes_at(h.rest, 1), plan->y[0] - lanes_at(out->x.rest, 1), n);
    }
    if (plan->present[n + 1]) {
        s = shock_of(P, a, a_rho, n);
        const tgi_gain h = {s.mu, lanes_of(s.rho, s.v, 0, 0), s.omega};
        const tg_real expected = dot(a, out->x.mu) + a_rho * lanes_at(out->x.rest, 0);
        update_channel(t, n + 1, &h, s.own, plan->y[n + 1] - plan->accelerometer_shift - expected, n);
    }
}

TG_INLINE int is_finite(const tgi_direct *out, const int n)
{
    const tgi_block *const P = &out->P;
    const tg_lanes none = lanes_all(0);
    tg_lanes a = out->x.mu * none, b = out->x.rest * none;
#define ADD(to, x) to += x * none
    ADD(a, out->x.omega);
    ADD(b, P->rho_mu);
    ADD(a, P->rho_rest);
    ADD(b, P->rho_omega);
    ADD(a, P->v_mu);
    ADD(b, P->v_rest);
    ADD(a, P->v_omega);
    for (int i = 0; i < n; i++) {
        ADD(a, P->mu[i]);
        ADD(b, P->omega[i]);
        ADD(a, P->omega_mu[i]);
    }
#undef ADD
    return lanes_sum(a + b) == 0;
}

TG_INLINE int direct_step(const tg_filter *f, const tg_real *P, const tgi_plan *plan, tgi_direct *out, const int n, const int stride)
{
    const tg_passage *const p = &plan->passage;
    const map m = {lanes_load(p->phi), lanes_load(p->b), lanes_load(p->c), p->g};
    tgi_block before;
    load_rows(P, &before, n, stride);
    block_predict(&m, p->q, &before, &out->P, n);
    if (!noise_holds(p->q, &out->P, n)) return 0;
    const tg_real *const x = f->x, *const shift = plan->shift;
    const tg_lanes mu = load_wheels(x, n), omega = load_wheels(x + n + 2, n);
    out->x.mu = mu;
    out->x.rest = lanes_of(x[n], (x[n + 1] - m.g * x[n]) + dot(m.c, mu) + shift[n + 1], 0, 0);
    out->x.omega = m.phi * omega + m.b * mu + load_wheels(shift + n + 2, n);
    out->x_prior = out->x;
    out->used = 0;
    out->result->square = 0;
    out->result->volume = 1;
    channel_updates t;
    t.out = out;
    t.noise = 1;
    if (plan->count) update_channels(f, plan, &t, n);
    out->result->used = out->used;
    return t.noise >= TGI_NOISE_SHARE * out->result->volume && is_finite(out, n);
}

int tgi_direct_step(const tg_filter *f, const tgi_plan *plan, tgi_direct *out)
{
    tg_real formed[TG_MAX_STATES * TG_ROWS];
    const tg_real *P = f->P;
    if (!f->formed) {
        tgi_covariance(f->states, f->stride, f->u, f->d, formed);
        P = formed;
    }
    return direct_step(f, P, plan, out, f->wheels, f->stride);
}

/* A row of three parts, in row order. */
TG_INLINE void store_row(tg_real *to, tg_lanes mu, tg_lanes rest, tg_lanes omega, const int n)
{
    if (n == TG_LANES) {
        lanes_store(to, mu);
        lanes_store(to + n + 2, omega);
    } else
        for (int i = 0; i < n; i++) {
            to[i] = lanes_at(mu, i);
            to[n + 2 + i] = lanes_at(omega, i);
        }
    to[n] = lanes_at(rest, 0);
    to[n + 1] = lanes_at(rest, 1);
}

void tgi_direct_gains(const tgi_direct *out, tg_real (*gain)[TG_ROWS], int n)
{
    for (int c = 0; c < out->used; c++) store_row(gain[c], out->gain[c].mu, out->gain[c].rest, out->gain[c].omega, n);
}

void tgi_direct_commit(tg_filter *f, const tgi_direct *out)
{
    const int n = f->wheels, stride = f->stride;
    const tgi_block *const P = &out->P;
    tg_real *const rho = f->P + n * stride, *const v = rho + stride;
    for (int i = 0; i < n; i++) {
        store_row(f->P + i * stride, P->mu[i], lanes_all(0), lanes_all(0), n);
        store_row(v + (1 + i) * stride, P->omega_mu[i], P->omega_rest[i], P->omega[i], n);
    }
    store_row(rho, P->rho_mu, P->rho_rest, P->rho_omega, n);
    store_row(v, P->v_mu, P->v_rest, P->v_omega, n);
    store_row(f->x, out->x.mu, out->x.rest, out->x.omega, n);
    store_row(f->x_prior, out->x_prior.mu, out->x_prior.rest, out->x_prior.omega, n);
    tgi_direct_gains(out, f->gain, n);
    f->formed = 1;
}
#endif
