/* Time of one tg_filter_step inside C, by method, and where the state ends: see kernel_step.py.
 *
 * Reads doubles from the file named first: wheels, steps, dt, mass, gravity, rho_t; radius, inertia, bearing (wheels each);
 * walk, x0 (2n+2), P0 ((2n+2)^2), r (n+1); then a row a step: torque, load (n each), drawbar, y (n+1).
 * Prints a line a method: name, nanoseconds a step (the best of some passes), the last state. */
#define _POSIX_C_SOURCE 199309L
#include "terragrip.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { PASSES = 5 };

static const struct {
    const char *name;
    int engine, policy;
} METHODS[] = {
    {"kalman", TG_EXACT, TG_FIXED},      {"bank", TG_EXACT, TG_BANK},           {"ukf", TG_UNSCENTED, TG_FIXED},
    {"aukf", TG_UNSCENTED, TG_ADAPTIVE}, {"aukf-fs", TG_UNSCENTED, TG_SUPERVISED},
};

static void stop(const char *why)
{
    fprintf(stderr, "kernel_step: %s\n", why);
    exit(1);
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void read_numbers(FILE *file, double *to, size_t count)
{
    if (fread(to, sizeof *to, count, file) != count) stop("the problem file is short");
}

int main(int argc, char **argv)
{
    if (argc != 2) stop("name the problem file");
    FILE *file = fopen(argv[1], "rb");
    if (!file) stop("the problem file cannot be read");
    double head[6];
    read_numbers(file, head, 6);
    const int n = (int)head[0], nx = 2 * n + 2, width = 3 * n + 2;
    const size_t steps = (size_t)head[1];
    const double dt = head[2];
    tg_machine machine;
    memset(&machine, 0, sizeof machine);
    machine.wheels = n;
    machine.mass = head[3];
    machine.gravity = head[4];
    machine.tire_rolling_resistance = head[5];
    read_numbers(file, machine.radius, (size_t)n);
    read_numbers(file, machine.inertia, (size_t)n);
    read_numbers(file, machine.bearing_resistance, (size_t)n);
    double walk[18], x0[18], P0[18 * 18], r[10] = {0}, q_input[18] = {0};
    read_numbers(file, walk, (size_t)nx);
    read_numbers(file, x0, (size_t)nx);
    read_numbers(file, P0, (size_t)(nx * nx));
    read_numbers(file, r, (size_t)(n + 1));
    r[n + 1] = 1.0; /* of the accelerometer, which is missing */
    double *rows = malloc(steps * (size_t)width * sizeof *rows);
    if (!rows) stop("no memory");
    read_numbers(file, rows, steps * (size_t)width);
    fclose(file);
    tg_filter *filter = malloc(sizeof *filter);
    if (!filter) stop("no memory");

    for (size_t m = 0; m < sizeof METHODS / sizeof *METHODS; m++) {
        double best = INFINITY, x[18];
        for (int pass = 0; pass < PASSES; pass++) {
            tg_tuning tuning = tg_default_tuning();
            tuning.engine = METHODS[m].engine;
            tuning.policy = METHODS[m].policy;
            tuning.huber = 0;
            memcpy(tuning.walk, walk, (size_t)nx * sizeof *walk);
            if (tg_filter_init(filter, &machine, &tuning, x0, P0) != TG_OK) stop("the filter refuses the problem");
            const double begin = seconds();
            for (size_t k = 0; k < steps; k++) {
                const double *row = rows + k * (size_t)width;
                tg_input input;
                tg_step step;
                double y[10];
                memset(&input, 0, sizeof input);
                memcpy(input.torque, row, (size_t)n * sizeof *row);
                memcpy(input.load, row + n, (size_t)n * sizeof *row);
                input.drawbar = row[2 * n];
                memcpy(y, row + 2 * n + 1, (size_t)(n + 1) * sizeof *row);
                y[n + 1] = NAN;
                if (tg_filter_step(filter, dt, &input, &input, q_input, y, r, &step) != TG_OK) stop("a step fails");
            }
            const double spent = (seconds() - begin) / (double)steps;
            if (spent < best) best = spent;
        }
        if (tg_filter_moments(filter, x, NULL) != TG_OK) stop("no moments");
        printf("%s %.3f", METHODS[m].name, 1e9 * best);
        for (int i = 0; i < nx; i++) printf(" %.17g", x[i]);
        printf("\n");
    }
    free(filter);
    free(rows);
    return 0;
}
