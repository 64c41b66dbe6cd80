/* The filter with a fixed Q, on random, badly scaled problems, against a dense Kalman filter: every wheel count, missing channels, uneven
 * and zero steps, stiff wheels, the accelerometer, soft weights, restarts. */
#include "check.h"

static double one_problem(int n, int engine, double huber, double missing, int steps)
{
    const int states = 2 * n + 2;
    const tg_machine m = random_machine(n);
    tg_tuning t = tg_default_tuning();
    static tg_filter f;
    static dense d;
    tg_real x[NX], P[NX * NX], y[NY], r[NY], q[NX];
    wide total[NX], truth[NX];
    double worst = 0;
    tg_input before = random_input(&m);
    t.engine = engine;
    t.huber = (tg_real)huber;
    for (int e = 0; e < states; e++) {
        t.walk[e] = (tg_real)pow(10, uniform(-5, -1));
        truth[e] = e < n ? 4 : e == n ? 0.8 : e < states - 1 ? 0.3 : 0.1;
    }
    random_covariance(states, sizeof(tg_real) == 8 ? 4 : 2, P);
    for (int e = 0; e < states; e++) x[e] = (tg_real)((double)truth[e] + normal() * sqrt((double)P[e * states + e]));
    CHECK(tg_filter_init(&f, &m, &t, x, P) == TG_OK, "init");
    dense_moments(&d, &m, x, P);
    for (int k = 0; k < steps; k++) {
        const tg_input now = random_input(&m);
        const double dt = k % 7 == 3 ? 0 : k % 50 == 20 ? 0.4 : uniform(0.001, 0.05);
        tg_step step;
        dense_move(&m, &before, (tg_real)dt, truth);
        for (int c = 0; c < n + 2; c++) {
            r[c] = (tg_real)pow(10, uniform(-4, -2));
            y[c] = (tg_real)(c <= n ? (double)truth[c] + 2 * sqrt((double)r[c]) * normal() : uniform(-1, 1));
            if (uniform(0, 1) < missing) y[c] = (tg_real)NAN;
        }
        for (int e = 0; e < states; e++) {
            q[e] = uniform(0, 1) < 0.5 ? 0 : (tg_real)uniform(0, 1e-4);
            total[e] = (wide)t.walk[e] * (tg_real)dt + q[e];
        }
        dense_predict(&d, &m, (tg_real)dt, &before, total);
        if (k % 11 == 5) { /* a step of prediction alone */
            CHECK(tg_filter_predict(&f, (tg_real)dt, &before, q) == TG_OK, "predict");
        } else {
            const tg_status status = tg_filter_step(&f, (tg_real)dt, &before, &now, q, y, r, &step);
            CHECK(status == TG_OK, "step %d: status %d", k, (int)status);
            dense_update(&d, &m, &now, y, r, huber, NULL);
            CHECK(step.channels == d.count, "channels");
            worst = fmax(worst, fabs((double)(step.nis - d.nis)) / (1 + (double)d.nis));
            worst = fmax(worst, fabs((double)(step.log_likelihood - d.log_likelihood)) / (10 + fabs((double)d.log_likelihood)));
            for (int a = 0; a < d.count; a++) {
                const int c = d.taken[a];
                const double S = (double)step.innovation_variance[c], w = (double)step.weight[c];
                worst = fmax(worst, fabs((double)(step.innovation[c] - d.nu[a])) / sqrt(S) / 30);
                worst = fmax(worst, fabs((double)(w - d.weight[a])));
                worst = fmax(worst, (double)fabsl((S - (wide)r[c] + (wide)r[c] / w - d.S[a][a]) / d.S[a][a]));
            }
        }
        if (k % 40 == 39) {
            tg_real outputs[NY], variances[NY];
            for (int i = 0; i < states; i++)
                for (int j = 0; j < states; j++)
                    if (i <= n || j <= n) d.P[i][j] = 0;
            for (int c = 0; c <= n; c++) {
                outputs[c] = (tg_real)normal();
                variances[c] = (tg_real)uniform(0.01, 1);
                d.x[c] = outputs[c];
                d.P[c][c] = variances[c];
            }
            for (int e = n + 1; e < states; e++) d.P[e][e] += 0.5L * t.walk[e];
            CHECK(tg_filter_restart(&f, (tg_real)0.5, outputs, variances) == TG_OK, "restart");
        }
        const double distance = dense_distance(&f, &d);
        worst = fmax(worst, distance);
        before = now;
    }
    return worst;
}

int main(void)
{
    const double tolerance = sizeof(tg_real) == 8 ? 1e-9 : 2e-2;
    for (int engine = 0; engine < 2; engine++)
        for (int n = 1; n <= TG_MAX_WHEELS; n++) {
            double worst = 0;
            for (int trial = 0; trial < 4; trial++)
                worst = fmax(worst, one_problem(n, engine, trial % 2 ? 1.5 : 0, trial < 2 ? 0 : 0.4, 150));
            printf("%s, %d wheels: off the dense Kalman filter by %.1e\n", engine ? "unscented" : "exact", n, worst);
            CHECK(worst < tolerance, "%g", worst);
        }
    return 0;
}
