/* libFuzzer: the filter floor with any machine, tuning, covariance, step and input. A status, never undefined behaviour; a refused call
 * leaves the filter as it was; an accepted one leaves a finite mean. */
#include "bytes.h"

static tg_filter f, before;
static tg_tuning tuning_of(bytes_left *b, int n);
static tg_input input_of(bytes_left *b, const tg_machine *m);

static void is_finite(int states)
{
    tg_real x[NX], P[NX * NX];
    CHECK(tg_filter_moments(&f, x, P) == TG_OK, "moments");
    for (int e = 0; e < states; e++) CHECK(isfinite((double)x[e]), "state %d", e);
}

static void one_step(bytes_left *b, int n)
{
    const tg_input held = input_of(b, &f.machine), now = byte_of(b) < 128 ? held : input_of(b, &f.machine);
    const unsigned kind = byte_of(b), missing = byte_of(b);
    const tg_real dt = kind & 64 ? number(b) : (tg_real)(0.001 * (1 + kind % 32));
    tg_real q[NX] = {0}, y[NY], r[NY];
    tg_step out;
    for (int j = 0; j < n + 2; j++) {
        y[j] = missing >> (j % 8) & 1 ? (tg_real)NAN : number(b);
        r[j] = kind & 32 ? number(b) : (tg_real)0.01;
    }
    if (kind & 128) q[byte_of(b) % (unsigned)(2 * n + 2)] = number(b);
    memcpy(&before, &f, sizeof f);
    tg_status status;
    if (kind % 8 == 6) status = tg_filter_predict(&f, dt, &held, q);
    else if (kind % 8 == 7) status = tg_filter_restart(&f, dt, y, r);
    else status = tg_filter_step(&f, dt, &held, &now, q, y, r, &out);
    if (status != TG_OK) CHECK(memcmp(&f, &before, sizeof f) == 0, "a refused call changed the filter");
    else is_finite(2 * n + 2);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_left b = {data, size};
    check_state = 88172645463325252u;
    const unsigned kind = byte_of(&b);
    const int n = 1 + (int)(kind % 8), states = 2 * n + 2;
    tg_machine m = random_machine(n);
    const tg_tuning t = tuning_of(&b, n);
    tg_real x[NX] = {0}, P[NX * NX] = {0};
    if (kind & 64) m.radius[byte_of(&b) % 8] = number(&b), m.inertia[byte_of(&b) % 8] = number(&b), m.mass = number(&b);
    for (int e = 0; e < states; e++) {
        x[e] = kind & 128 ? number(&b) : (tg_real)0.1;
        P[e * states + e] = kind & 128 ? number(&b) : (tg_real)0.1;
    }
    if (kind & 32) P[1] = P[states] = number(&b);
    if (tg_filter_init(&f, &m, &t, x, P) != TG_OK) return 0;
    for (int row = 0; row < 64 && b.left; row++) one_step(&b, n);
    return 0;
}

static tg_tuning tuning_of(bytes_left *b, int n)
{
    const unsigned kind = byte_of(b);
    tg_tuning t = tg_default_tuning();
    t.engine = (int32_t)(kind >> 2 & 1);
    t.policy = (int32_t)(kind & 3);
    for (int e = 0; e < 2 * n + 2; e++) t.walk[e] = (tg_real)0.01;
    if (kind & 8) t.walk[byte_of(b) % 18] = number(b);
    if (kind & 16) t.huber = number(b), t.rate = number(b), t.memory = number(b);
    if (kind & 32) t.alpha = number(b), t.beta = number(b), t.kappa = number(b);
    if (kind & 64) t.window = number(b), t.supervisor = (int32_t)byte_of(b) - 1, t.stride = (int32_t)byte_of(b) - 1;
    if (kind & 128) t.scales[byte_of(b) % 4] = number(b), t.dwell = number(b), t.mix_stride = (int32_t)byte_of(b) - 1;
    return t;
}

static tg_input input_of(bytes_left *b, const tg_machine *m)
{
    const unsigned kind = byte_of(b);
    tg_input u = random_input(m);
    if (kind & 1) u.torque[byte_of(b) % 8] = number(b);
    if (kind & 2) u.load[byte_of(b) % 8] = number(b);
    if (kind & 4) u.drawbar = number(b);
    if (kind & 8) u.slope = number(b);
    return u;
}
