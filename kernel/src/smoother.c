/* Smoother: Rauch, Tung and Striebel (1965) backwards over records, one a row, written forwards.
 *
 * Between two records lies an affine map x' = F x + shift with noise Q, composed of all steps in between. With
 * G = P F' (F P F' + Q)^-1 the smoothed covariance is computed as (I - G F) P (I - G F)' + G Q G' + G P' G': a sum of terms that are each
 * positive semidefinite, unlike P + G (P' - P_prior) G'. Of a bank, moments and noise are the mixture's: an approximation. */
#include "filter.h"

enum { S = TG_MAX_STATES };

typedef struct { /* places in a record, state order throughout */
    int states, columns;
    size_t x, P, prior, map, Q, s, s_prior, length;
} layout;

static layout lay_out(int32_t wheels, int32_t columns)
{
    const size_t states = (size_t)TG_TWICE(wheels), pairs = states * (states + 1) / 2, block = states * (size_t)columns;
    layout l;
    l.states = (int)states;
    l.columns = columns;
    l.x = 0;
    l.P = l.x + states;
    l.prior = l.P + pairs;
    l.map = l.prior + states; /* phi, b, c of each wheel, keep, g */
    l.Q = l.map + 3 * (size_t)wheels + 2;
    l.s = l.Q + pairs;
    l.s_prior = l.s + block;
    l.length = l.s_prior + block;
    return l;
}

static int sizes_are_known(int32_t wheels, int32_t columns)
{
    return wheels >= 1 && wheels <= TG_MAX_WHEELS && columns >= 0 && columns <= TG_MAX_CONSIDERED;
}

static void pack(int states, const tg_real *P, tg_real *pairs)
{
    for (int i = 0; i < states; i++)
        for (int j = 0; j <= i; j++) *pairs++ = P[i * states + j];
}

static void unpack(int states, const tg_real *pairs, tg_real *P)
{
    for (int i = 0; i < states; i++)
        for (int j = 0; j <= i; j++) P[i * states + j] = P[j * states + i] = *pairs++;
}

/* The map of a record or passage as a dense matrix, state order. */
static void dense(int wheels, const tg_real *phi, const tg_real *b, const tg_real *c, tg_real keep, tg_real g, tg_real *F)
{
    const int states = TG_TWICE(wheels), v = wheels, rho = states - 1;
    for (int i = 0; i < states * states; i++) F[i] = 0;
    for (int i = v + 1; i < states; i++) F[i * states + i] = 1;
    for (int i = 0; i < wheels; i++) {
        F[i * states + i] = phi[i];
        F[i * states + v + 1 + i] = b[i];
        F[v * states + v + 1 + i] = c[i];
    }
    F[v * states + v] = keep;
    F[v * states + rho] = -g;
}

/* C = A B, or A B' where `transposed`; states by states. */
static void multiply(int states, const tg_real *A, const tg_real *B, int transposed, tg_real *C)
{
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) {
            tg_real sum = 0;
            for (int k = 0; k < states; k++) sum += A[i * states + k] * (transposed ? B[j * states + k] : B[k * states + j]);
            C[i * states + j] = sum;
        }
}

/* C += A B A', B symmetric. */
static void add_congruence(int states, const tg_real *A, const tg_real *B, tg_real *C)
{
    tg_real AB[S * S], sum[S * S];
    multiply(states, A, B, 0, AB);
    multiply(states, AB, A, 1, sum);
    for (int i = 0; i < states; i++)
        for (int j = 0; j < states; j++) C[i * states + j] += (sum[i * states + j] + sum[j * states + i]) / 2;
}

int tgi_divide_rows(int states, int stride, tg_real *M, tg_real *X)
{
    for (int j = 0; j < states; j++)
        for (int i = j; i < states; i++) {
            tg_real sum = M[i * stride + j];
            for (int k = 0; k < j; k++) sum -= M[i * stride + k] * M[j * stride + k];
            if (i == j && !(sum > 0)) return 0;
            M[i * stride + j] = i == j ? tgi_sqrt(sum) : sum / M[j * stride + j];
        }
    for (int r = 0; r < states; r++) {
        tg_real *const x = X + r * stride;
        for (int i = 0; i < states; i++) {
            for (int k = 0; k < i; k++) x[i] -= M[i * stride + k] * x[k];
            x[i] /= M[i * stride + i];
        }
        for (int i = states - 1; i >= 0; i--) {
            for (int k = i + 1; k < states; k++) x[i] -= M[k * stride + i] * x[k];
            x[i] /= M[i * stride + i];
        }
    }
    return 1;
}

size_t tg_track_size(void) { return sizeof(tg_track); }

static void track_restart(tg_track *t)
{
    tg_passage *const p = &t->passage;
    memset(p, 0, sizeof *p);
    memset(t->Q, 0, sizeof t->Q);
    t->used = 0;
    p->keep = 1;
    for (int i = 0; i < t->wheels; i++) p->phi[i] = 1;
}

tg_status tg_track_init(tg_track *t, const tg_filter *f)
{
    if (!t || !f) return TG_BAD_ARGUMENT;
    t->wheels = f->wheels;
    t->states = f->states;
    track_restart(t);
    return TG_OK;
}

tg_status tg_track_step(tg_track *t, const tg_filter *f)
{
    if (!t || !f || t->wheels != f->wheels || t->used) return TG_BAD_ARGUMENT;
    const int n = t->wheels, states = t->states;
    const tg_passage *const step = &f->passage;
    tg_passage *const whole = &t->passage;
    tg_real F[S * S], Q[S * S];
    dense(n, step->phi, step->b, step->c, step->keep, step->g, F);
    memset(Q, 0, sizeof Q);
    add_congruence(states, F, t->Q, Q);
    for (int e = 0; e < states; e++) Q[e * states + e] += step->q[tgi_row(n, e)];
    memcpy(t->Q, Q, sizeof Q);
    for (int i = 0; i < n; i++) {
        whole->b[i] = step->phi[i] * whole->b[i] + step->b[i];
        whole->phi[i] *= step->phi[i];
        whole->c[i] = step->keep * whole->c[i] + step->c[i];
    }
    whole->g = step->keep * whole->g + step->g;
    whole->keep *= step->keep;
    t->used = f->used;
    return TG_OK;
}

size_t tg_record_length(int32_t wheels, int32_t columns)
{
    return sizes_are_known(wheels, columns) ? lay_out(wheels, columns).length : 0;
}

tg_status tg_record_take(tg_real *record, tg_track *t, const tg_filter *f, const tg_consider *c)
{
    if (!record || !t || !f || t->wheels != f->wheels || (c && c->wheels != f->wheels)) return TG_BAD_ARGUMENT;
    const int n = f->wheels;
    const layout l = lay_out(n, c ? c->columns : 0);
    tg_real P[S * S];
    const tg_status status = tg_filter_moments(f, record + l.x, P);
    if (status != TG_OK) return status;
    pack(l.states, P, record + l.P);
    pack(l.states, t->Q, record + l.Q);
    for (int e = 0; e < l.states; e++) {
        record[l.prior + (size_t)e] = f->x_prior[tgi_row(n, e)];
        for (int k = 0; k < l.columns; k++) {
            const size_t at = (size_t)(k * l.states + e);
            record[l.s + at] = c->s[tgi_row(n, e)][k];
            record[l.s_prior + at] = c->prior[tgi_row(n, e)][k];
        }
    }
    tg_real *const map = record + l.map;
    for (int i = 0; i < n; i++) {
        map[i] = t->passage.phi[i];
        map[n + i] = t->passage.b[i];
        map[2 * n + i] = t->passage.c[i];
    }
    map[3 * n] = t->passage.keep;
    map[3 * n + 1] = t->passage.g;
    track_restart(t);
    return TG_OK;
}

tg_status tg_record_moments(int32_t wheels, int32_t columns, const tg_real *record, tg_real *x, tg_real *P, tg_real *s)
{
    if (!record || !x || !P || (columns && !s) || !sizes_are_known(wheels, columns)) return TG_BAD_ARGUMENT;
    const layout l = lay_out(wheels, columns);
    memcpy(x, record + l.x, (size_t)l.states * sizeof *x);
    unpack(l.states, record + l.P, P);
    if (columns) memcpy(s, record + l.s, (size_t)(l.columns * l.states) * sizeof *s);
    return TG_OK;
}

tg_status tg_smooth_step(int32_t wheels, int32_t columns, const tg_real *here, const tg_real *next, tg_real *x, tg_real *P, tg_real *s)
{
    if (!here || !next || !x || !P || (columns && !s) || !sizes_are_known(wheels, columns)) return TG_BAD_ARGUMENT;
    const layout l = lay_out(wheels, columns);
    const int states = l.states;
    const tg_real *const map = next + l.map;
    tg_real F[S * S], Q[S * S], before[S * S], prior[S * S], G[S * S], rest[S * S], smooth[S * S];
    dense(wheels, map, map + wheels, map + 2 * wheels, map[3 * wheels], map[3 * wheels + 1], F);
    unpack(states, next + l.Q, Q);
    unpack(states, here + l.P, before);
    memcpy(prior, Q, sizeof Q);
    add_congruence(states, F, before, prior);
    multiply(states, before, F, 1, G);
    if (!tgi_divide_rows(states, states, prior, G)) return TG_NOT_POSITIVE;
    multiply(states, G, F, 0, rest);
    for (int i = 0; i < states * states; i++) rest[i] = (i % (states + 1) == 0) - rest[i];
    memset(smooth, 0, sizeof smooth);
    add_congruence(states, rest, before, smooth);
    add_congruence(states, G, Q, smooth);
    add_congruence(states, G, P, smooth);
    tg_real zero = 0;
    for (int i = 0; i < states * states; i++) zero += smooth[i] * 0;
    if (zero != 0) return TG_DIVERGED;
    memcpy(P, smooth, (size_t)(states * states) * sizeof *P);
    for (int k = -1; k < columns; k++) { /* the mean, then the considered columns, by the same gain */
        tg_real *const value = k < 0 ? x : s + k * states;
        const tg_real *const own = here + (k < 0 ? l.x : l.s + (size_t)(k * states));
        const tg_real *const expected = next + (k < 0 ? l.prior : l.s_prior + (size_t)(k * states));
        tg_real correction[S];
        for (int i = 0; i < states; i++) correction[i] = value[i] - expected[i];
        for (int i = 0; i < states; i++) {
            value[i] = own[i];
            for (int j = 0; j < states; j++) value[i] += G[i * states + j] * correction[j];
        }
    }
    return TG_OK;
}
