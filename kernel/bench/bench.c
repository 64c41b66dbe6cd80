/* Time of one step inside the kernel, by method. Build and run from the repository's root:
 *   cc -std=c99 -O3 -fno-math-errno -fno-trapping-math -ffp-contract=off [-mavx2 -mfma] [-DTG_FLOAT] -Ikernel/include \
 *      kernel/bench/bench.c kernel/src/[a-z]*.c -lm -o build/bench && build/bench
 * The clock is the processor time of this program; each figure is the least of several rounds. */
#include "terragrip.h"
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define SAMPLES 512
#define ROUNDS 60

static tg_filter filter;
static tg_consider consider;
static tg_input inputs[SAMPLES];
static tg_real y[SAMPLES][TG_MAX_CHANNELS], r[TG_MAX_CHANNELS], q[TG_MAX_STATES];

static tg_real noise(void)
{
    static uint32_t state = 1;
    tg_real sum = 0;
    for (int i = 0; i < 4; i++) {
        state = state * 1664525u + 1013904223u;
        sum += (tg_real)(state >> 8) / (tg_real)16777216 - (tg_real)0.5;
    }
    return sum * (tg_real)1.732;
}

static tg_machine machine(int n)
{
    tg_machine m;
    memset(&m, 0, sizeof m);
    m.wheels = n;
    m.mass = 139;
    m.gravity = (tg_real)9.81;
    m.tire_rolling_resistance = (tg_real)0.02;
    for (int i = 0; i < n; i++) {
        m.radius[i] = (tg_real)0.2;
        m.inertia[i] = (tg_real)0.15;
        m.bearing_resistance[i] = 2;
    }
    return m;
}

static void signals(int n, int accelerometer)
{
    for (int k = 0; k < SAMPLES; k++) {
        memset(&inputs[k], 0, sizeof inputs[k]);
        for (int i = 0; i < n; i++) {
            inputs[k].load[i] = 139 * (tg_real)9.81 / (tg_real)n * (1 + (tg_real)0.02 * noise());
            inputs[k].torque[i] = 25 + noise();
            y[k][i] = 4 + (tg_real)0.03 * noise();
        }
        inputs[k].drawbar = 150 + 4 * noise();
        y[k][n] = (tg_real)0.7 + (tg_real)0.02 * noise();
        y[k][n + 1] = accelerometer ? (tg_real)0.3 * noise() : (tg_real)NAN;
    }
    for (int i = 0; i < n; i++) r[i] = (tg_real)9e-4;
    r[n] = (tg_real)4e-4;
    r[n + 1] = (tg_real)0.09;
    for (int e = 0; e < 2 * n + 2; e++) q[e] = e <= n ? (tg_real)1e-6 : 0;
}

static double seconds(void) { return (double)clock() / CLOCKS_PER_SEC; }

static void time_method(const char *name, int n, int engine, int policy, int accelerometer, int columns)
{
    const int states = 2 * n + 2;
    tg_real x0[TG_MAX_STATES] = {0}, P0[TG_MAX_STATES * TG_MAX_STATES] = {0};
    tg_tuning tuning = tg_default_tuning();
    const tg_machine m = machine(n);
    tg_deviation deviation[TG_MAX_CONSIDERED];
    tg_step step;
    double best = 1e9;
    tuning.engine = engine;
    tuning.policy = policy;
    tuning.huber = 3;
    for (int e = 0; e < states; e++) {
        tuning.walk[e] = e <= n ? (tg_real)1e-2 : (tg_real)0.02;
        P0[e * states + e] = e <= n ? (tg_real)0.01 : (tg_real)0.1;
    }
    memset(deviation, 0, sizeof deviation);
    for (int p = 0; p < columns; p++) deviation[p].acceleration = (tg_real)0.02;
    signals(n, accelerometer);
    for (int round = 0; round < ROUNDS; round++) {
        tg_status status = tg_filter_init(&filter, &m, &tuning, x0, P0);
        if (columns && status == TG_OK) status = tg_consider_init(&consider, &filter, columns);
        const int steps = n > 4 ? 1000 : 4000;
        const double start = seconds();
        for (int k = 0; k < steps && status == TG_OK; k++) {
            const int now = k % SAMPLES, before = (k + SAMPLES - 1) % SAMPLES;
            status = tg_filter_step(&filter, (tg_real)0.01, &inputs[before], &inputs[now], q, y[now], r, &step);
            if (columns && status == TG_OK) status = tg_consider_step(&consider, &filter, deviation);
        }
        if (status != TG_OK) {
            printf("%-34s status %d\n", name, (int)status);
            return;
        }
        const double each = (seconds() - start) / steps * 1e9;
        if (each < best) best = each;
    }
    printf("%-34s %d wheels %8.0f ns\n", name, n, best);
}

int main(void)
{
    static const int wheels[] = {1, 2, 4, 6, 8};
    time_method("kalman (exact, fixed)", 4, TG_EXACT, TG_FIXED, 0, 0);
    time_method("kalman + accelerometer", 4, TG_EXACT, TG_FIXED, 1, 0);
    time_method("kalman + 7 considered", 4, TG_EXACT, TG_FIXED, 0, 7);
    time_method("ukf (unscented, fixed)", 4, TG_UNSCENTED, TG_FIXED, 0, 0);
    time_method("ukf + accelerometer", 4, TG_UNSCENTED, TG_FIXED, 1, 0);
    time_method("aukf (unscented, adaptive)", 4, TG_UNSCENTED, TG_ADAPTIVE, 0, 0);
    time_method("aukf-fs (unscented, supervised)", 4, TG_UNSCENTED, TG_SUPERVISED, 0, 0);
    time_method("exact, supervised", 4, TG_EXACT, TG_SUPERVISED, 0, 0);
    time_method("bank", 4, TG_EXACT, TG_BANK, 0, 0);
    time_method("bank + accelerometer", 4, TG_EXACT, TG_BANK, 1, 0);
    time_method("bank + 7 considered", 4, TG_EXACT, TG_BANK, 0, 7);
    for (size_t i = 0; i < sizeof wheels / sizeof *wheels; i++) {
        time_method("kalman", wheels[i], TG_EXACT, TG_FIXED, 0, 0);
        time_method("ukf", wheels[i], TG_UNSCENTED, TG_FIXED, 0, 0);
        time_method("aukf-fs", wheels[i], TG_UNSCENTED, TG_SUPERVISED, 0, 0);
        time_method("bank", wheels[i], TG_EXACT, TG_BANK, 0, 0);
    }
    return 0;
}
