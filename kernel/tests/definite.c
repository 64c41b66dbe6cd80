/* Covariances stay positive definite for 2000 steps, or as many as the command line says (make test-long: 10 000), every engine and policy,
 * with P0 x 1e6, R x 1e-6 and Q x 1e-4, alone and together: every d of P = U diag(d) U' is positive and finite, and no step fails. Run in
 * double and in float. */
#include "check.h"

enum { WHEELS = 4, STATES = 2 * WHEELS + 2 };

static const struct {
    const char *name;
    int32_t engine, policy;
} methods[] = {
    {"exact fixed", TG_EXACT, TG_FIXED},           {"exact adaptive", TG_EXACT, TG_ADAPTIVE},
    {"exact supervised", TG_EXACT, TG_SUPERVISED}, {"exact bank", TG_EXACT, TG_BANK},
    {"unscented fixed", TG_UNSCENTED, TG_FIXED},   {"unscented adaptive", TG_UNSCENTED, TG_ADAPTIVE},
    {"unscented supervised", TG_UNSCENTED, TG_SUPERVISED},
};

static void check_factors(const tg_filter *f, int modes, const char *name, int scaling, int step)
{
    tg_real U[STATES * STATES], D[STATES];
    for (int m = 0; m < modes; m++) {
        CHECK(tg_filter_factors(f, m, U, D) == TG_OK, "%s", name);
        for (int k = 0; k < STATES; k++) {
            CHECK(D[k] > 0 && isfinite(D[k]), "%s, scaling %d, step %d, mode %d: d[%d] = %g", name, scaling, step, m, k, (double)D[k]);
            for (int e = 0; e < STATES; e++)
                CHECK(isfinite(U[e * STATES + k]), "%s, scaling %d, step %d: U is not finite", name, scaling, step);
        }
    }
}

static void run(int method, int scaling, int steps)
{
    static tg_filter f;
    const tg_machine machine = random_machine(WHEELS);
    tg_tuning tuning = tg_default_tuning();
    tuning.engine = methods[method].engine;
    tuning.policy = methods[method].policy;
    const double p = scaling & 1 ? 1e6 : 1, r = scaling & 2 ? 1e-6 : 1, q = scaling & 4 ? 1e-4 : 1;
    tg_real x0[STATES] = {0}, P0[STATES * STATES] = {0}, y[WHEELS + 2], noise[WHEELS + 2];
    for (int e = 0; e < STATES; e++) {
        tuning.walk[e] = (tg_real)(q * (e <= WHEELS ? 0.05 : 0.02));
        P0[e * STATES + e] = (tg_real)(p * (e <= WHEELS ? 0.5 : 0.1));
        for (int k = 0; k < e; k++) P0[e * STATES + k] = P0[k * STATES + e] = (tg_real)(p * 0.005); /* a full matrix */
    }
    for (int c = 0; c < WHEELS + 2; c++) noise[c] = (tg_real)(r * 9e-4);
    CHECK(tg_filter_init(&f, &machine, &tuning, x0, P0) == TG_OK, "%s, scaling %d", methods[method].name, scaling);
    tg_input before = random_input(&machine), now = before;
    tg_step out;
    for (int step = 0; step < steps; step++) {
        const tg_real dt = (tg_real)uniform(0.002, 0.03);
        if (step % 50 == 0) now = random_input(&machine);
        for (int c = 0; c < WHEELS + 2; c++) y[c] = uniform(0, 1) < 0.1 ? (tg_real)NAN : (tg_real)(c < WHEELS ? 3 + 0.1 * normal() : 0.7 + 0.02 * normal());
        if (uniform(0, 1) < 0.5) y[WHEELS + 1] = (tg_real)NAN; /* the accelerometer comes at half the steps */
        const tg_status status = tg_filter_step(&f, dt, &before, &now, NULL, y, noise, &out);
        CHECK(status == TG_OK, "%s, scaling %d, step %d: status %d", methods[method].name, scaling, step, (int)status);
        check_factors(&f, tuning.policy == TG_BANK ? TG_MODES : 1, methods[method].name, scaling, step);
        before = now;
    }
}

int main(int count, char **words)
{
    const int steps = count > 1 ? atoi(words[1]) : 2000;
    for (int method = 0; method < (int)(sizeof methods / sizeof *methods); method++) {
        for (int scaling = 0; scaling < 8; scaling++) run(method, scaling, steps);
        printf("%s: positive definite for %d steps under all 8 scalings\n", methods[method].name, steps);
    }
    return 0;
}
