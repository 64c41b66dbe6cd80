/* The bank against four dense filters mixed by the book: means, covariance, probabilities, likelihood, soft weights by the mixture. */
#include "check.h"

enum { MODES = TG_MODES, STEPS = 120 };

static dense modes[MODES];
static wide probability[MODES];

static void mix(int states, wide elapsed, const tg_tuning *t)
{
    static dense mixed[MODES];
    const wide stay = expl(-elapsed / t->dwell);
    wide next[MODES];
    for (int j = 0; j < MODES; j++) {
        wide share[MODES];
        next[j] = 0;
        for (int i = 0; i < MODES; i++) next[j] += share[i] = (i == j ? stay : (1 - stay) / 3) * probability[i];
        mixed[j] = modes[j];
        for (int a = 0; a < states; a++) {
            mixed[j].x[a] = 0;
            for (int i = 0; i < MODES; i++) mixed[j].x[a] += share[i] / next[j] * modes[i].x[a];
        }
        for (int a = 0; a < states; a++)
            for (int b = 0; b < states; b++) {
                mixed[j].P[a][b] = 0;
                for (int i = 0; i < MODES; i++)
                    mixed[j].P[a][b] += share[i] / next[j] * (modes[i].P[a][b] + (modes[i].x[a] - mixed[j].x[a]) * (modes[i].x[b] - mixed[j].x[b]));
            }
    }
    memcpy(modes, mixed, sizeof modes);
    memcpy(probability, next, sizeof next);
}

/* Mixture of the modes as if it were one dense filter. */
static dense mixture(int states)
{
    dense d = modes[0];
    for (int a = 0; a < states; a++) {
        d.x[a] = 0;
        for (int i = 0; i < MODES; i++) d.x[a] += probability[i] * modes[i].x[a];
    }
    for (int a = 0; a < states; a++)
        for (int b = 0; b < states; b++) {
            d.P[a][b] = 0;
            for (int i = 0; i < MODES; i++)
                d.P[a][b] += probability[i] * (modes[i].P[a][b] + (modes[i].x[a] - d.x[a]) * (modes[i].x[b] - d.x[b]));
        }
    return d;
}

static double one_problem(int n, double huber, double missing)
{
    static tg_filter f;
    const int states = 2 * n + 2;
    const tg_machine m = random_machine(n);
    tg_tuning t = tg_default_tuning();
    tg_real x[NX], P[NX * NX], y[NY], r[NY], q[NX];
    wide truth[NX], clock = 0, mixed_at = 0;
    double worst = 0;
    int updates = 0;
    tg_input before = random_input(&m);
    t.policy = TG_BANK;
    t.huber = (tg_real)huber;
    for (int e = 0; e < states; e++) {
        t.walk[e] = (tg_real)pow(10, uniform(-4, -1));
        truth[e] = e < n ? 4 : e == n ? 0.8 : e < states - 1 ? 0.3 : 0.1;
    }
    random_covariance(states, 2, P);
    for (int e = 0; e < states; e++) x[e] = (tg_real)((double)truth[e] + 0.3 * normal());
    CHECK(tg_filter_init(&f, &m, &t, x, P) == TG_OK, "init");
    for (int i = 0; i < MODES; i++) {
        dense_moments(&modes[i], &m, x, P);
        probability[i] = 0.25;
    }
    for (int k = 0; k < STEPS; k++) {
        const tg_input now = random_input(&m);
        const tg_real dt = (tg_real)(k % 9 == 4 ? 0 : uniform(0.005, 0.05));
        tg_step step;
        int present = 0;
        dense_move(&m, &before, dt, truth);
        for (int c = 0; c < n + 2; c++) {
            r[c] = (tg_real)pow(10, uniform(-3, -2));
            y[c] = (tg_real)(c <= n ? (double)truth[c] + 2 * sqrt((double)r[c]) * normal() : uniform(-1, 1));
            if (uniform(0, 1) < missing || k % 13 == 12) y[c] = (tg_real)NAN;
            present += y[c] == y[c];
        }
        for (int e = 0; e < states; e++) q[e] = (tg_real)uniform(0, 1e-4);
        if (present && ++updates % t.mix_stride == 0) {
            mix(states, clock - mixed_at, &t);
            mixed_at = clock;
        }
        for (int i = 0; i < MODES; i++) {
            wide total[NX];
            for (int e = 0; e < states; e++) total[e] = (wide)t.scales[i] * t.walk[e] * dt + q[e];
            dense_predict(&modes[i], &m, dt, &before, total);
        }
        clock += dt;
        CHECK(tg_filter_step(&f, dt, &before, &now, q, y, r, &step) == TG_OK, "step %d", k);
        CHECK(step.channels == present, "channels");
        CHECK(factors_are_sound(&f, states, TG_MODES), "positive definite");
        if (present) {
            dense prior = mixture(states), plain = prior;
            wide weights[NY], largest = -1e30L, sum = 0;
            dense_update(&prior, &m, &now, y, r, huber, NULL);
            dense_update(&plain, &m, &now, y, r, 0, NULL);
            for (int a = 0; a < prior.count; a++) {
                const int c = prior.taken[a];
                weights[c] = prior.weight[a];
                worst = fmax(worst, fabs((double)(step.innovation[c] - prior.nu[a])));
                worst = fmax(worst, fabs((double)(step.innovation_variance[c] / plain.S[a][a] - 1)));
                worst = fmax(worst, fabs((double)(step.weight[c] - prior.weight[a])));
            }
            worst = fmax(worst, fabs((double)(step.nis - prior.nis)) / (1 + (double)prior.nis));
            for (int i = 0; i < MODES; i++) {
                dense_update(&modes[i], &m, &now, y, r, 0, weights);
                if (modes[i].log_likelihood > largest) largest = modes[i].log_likelihood;
            }
            for (int i = 0; i < MODES; i++) sum += probability[i] *= expl(modes[i].log_likelihood - largest);
            worst = fmax(worst, fabs((double)(step.log_likelihood - (largest + logl(sum)))) / 10);
            wide kept = 0;
            for (int i = 0; i < MODES; i++) {
                probability[i] /= sum;
                if (probability[i] < 1e-12L) probability[i] = 1e-12L;
                kept += probability[i];
            }
            for (int i = 0; i < MODES; i++) probability[i] /= kept;
        }
        for (int i = 0; i < MODES; i++) worst = fmax(worst, fabs((double)(step.mode[i] - probability[i])));
        if (k % 40 == 39) {
            tg_real outputs[NY], variances[NY];
            for (int c = 0; c <= n; c++) {
                outputs[c] = (tg_real)(double)truth[c];
                variances[c] = (tg_real)uniform(0.01, 1);
            }
            for (int i = 0; i < MODES; i++) {
                for (int a = 0; a < states; a++)
                    for (int b = 0; b < states; b++)
                        if (a <= n || b <= n) modes[i].P[a][b] = 0;
                for (int c = 0; c <= n; c++) {
                    modes[i].x[c] = outputs[c];
                    modes[i].P[c][c] = variances[c];
                }
                for (int e = n + 1; e < states; e++) modes[i].P[e][e] += (wide)t.scales[i] * t.walk[e] * 0.25L;
            }
            CHECK(tg_filter_restart(&f, (tg_real)0.25, outputs, variances) == TG_OK, "restart");
        }
        const dense whole = mixture(states);
        worst = fmax(worst, dense_distance(&f, &whole));
        before = now;
    }
    return worst;
}

int main(void)
{
    const double tolerance = sizeof(tg_real) == 8 ? 1e-9 : 2e-2;
    for (int n = 1; n <= TG_MAX_WHEELS; n++) {
        double worst = 0;
        for (int trial = 0; trial < 4; trial++) worst = fmax(worst, one_problem(n, trial % 2 ? 1.5 : 0, trial < 2 ? 0 : 0.3));
        printf("bank, %d wheels: off four dense filters, mixed, by %.1e\n", n, worst);
        CHECK(worst < tolerance, "%g", worst);
    }
    return 0;
}
