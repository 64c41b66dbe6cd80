/* The exact step on the covariance itself, against a dense Kalman filter in long double: drives whose noise is an honest share of what is
 * known go there and agree to 1e-11; sensors a thousand times finer break the bound, go to factors, and agree as well. */
#include "check.h"

enum { STEPS = 600 };

static struct {
    double worst;
    int formed, turns; /* steps on the covariance; changes between the two ways */
} seen;

static void drive(int n, double sensors, double missing, int accelerometer, double huber)
{
    const int states = 2 * n + 2;
    const tg_machine m = random_machine(n);
    tg_tuning t = tg_default_tuning();
    static tg_filter f;
    static dense d;
    tg_real x[NX], P[NX * NX] = {0}, y[NY], r[NY], q[NX] = {0};
    wide noise[NX], truth[NX];
    tg_input before = random_input(&m);
    t.huber = (tg_real)huber;
    for (int e = 0; e < states; e++) {
        t.walk[e] = (tg_real)(e < n ? 2e-2 : e == n ? 1e-3 : e < states - 1 ? 3e-3 : 1e-3);
        truth[e] = e < n ? 4 : e == n ? 0.8 : e < states - 1 ? 0.3 : 0.1;
        P[e * states + e] = (tg_real)(e <= n ? 1e-2 : 4e-2);
        x[e] = (tg_real)((double)truth[e] + 0.1 * normal());
    }
    CHECK(tg_filter_init(&f, &m, &t, x, P) == TG_OK, "init");
    dense_moments(&d, &m, x, P);
    for (int k = 0; k < STEPS; k++) {
        const tg_input now = random_input(&m);
        const tg_real dt = (tg_real)uniform(0.008, 0.012);
        tg_step step;
        const int was = f.formed;
        dense_move(&m, &before, dt, truth);
        for (int c = 0; c < n + 2; c++) {
            r[c] = (tg_real)((c < n ? 9e-4 : c == n ? 4e-4 : 0.09) * sensors);
            y[c] = (tg_real)((c <= n ? (double)truth[c] : 0.0) + 2 * sqrt((double)r[c]) * normal());
            if (uniform(0, 1) < missing || (c == n + 1 && !accelerometer)) y[c] = (tg_real)NAN;
        }
        for (int e = 0; e < states; e++) {
            if (e <= n) q[e] = t.walk[e] * dt;
            noise[e] = (wide)t.walk[e] * dt + q[e];
        }
        dense_predict(&d, &m, dt, &before, noise);
        if (k % 37 == 20) {
            CHECK(tg_filter_predict(&f, dt, &before, q) == TG_OK, "predict");
        } else {
            CHECK(tg_filter_step(&f, dt, &before, &now, q, y, r, &step) == TG_OK, "step %d", k);
            dense_update(&d, &m, &now, y, r, huber, NULL);
            CHECK(step.channels == d.count, "channels");
            seen.worst = fmax(seen.worst, fabs((double)(step.nis - d.nis)) / (1 + (double)d.nis));
            for (int a = 0; a < d.count; a++) {
                const int c = d.taken[a];
                seen.worst = fmax(seen.worst, fabs((double)(step.innovation[c] - d.nu[a])) / sqrt((double)step.innovation_variance[c]) / 30);
                seen.worst = fmax(seen.worst, fabs((double)(step.weight[c] - d.weight[a])));
            }
        }
        seen.worst = fmax(seen.worst, (double)dense_distance(&f, &d));
        CHECK(factors_are_sound(&f, states, 1), "positive definite");
        seen.formed += f.formed;
        seen.turns += f.formed != was;
        before = now;
    }
}

static void report(const char *name, int n)
{
    printf("%s, %d wheels: off the dense Kalman filter by %.1e, %d steps on the covariance, %d turns\n", name, n, seen.worst, seen.formed, seen.turns);
}

int main(void)
{
    if (sizeof(tg_real) != sizeof(double)) return 0; /* single precision always takes factors: kalman.c, definite.c */
    for (int n = 1; n <= 4; n++) {
        memset(&seen, 0, sizeof seen);
        for (int trial = 0; trial < 4; trial++) drive(n, 1, trial & 1 ? 0.3 : 0, trial & 2, trial & 1 ? 1.5 : 0);
        report("as they are", n);
        CHECK(seen.worst < 1e-11, "%g", seen.worst);
        CHECK(seen.formed > 4 * STEPS * 9 / 10, "most steps do without factors");
        memset(&seen, 0, sizeof seen);
        drive(n, 1e-6, 0, 1, 0);
        report("finer", n);
        CHECK(seen.worst < 1e-9, "%g", seen.worst);
        CHECK(seen.formed == 0, "nothing enough is left of");
        memset(&seen, 0, sizeof seen);
        drive(n, 2e-2, 0.5, 0, 0);
        report("in between", n);
        CHECK(seen.worst < 1e-10, "%g", seen.worst);
    }
    return 0;
}
