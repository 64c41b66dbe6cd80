/* The filter of terragrip on a controller, in storage of its own: samples come in, estimates go out (docs/controller.md).
 *
 * Here both are rows of CSV on standard input and output, so that it runs on any computer; a controller reads its sensors and its bus in place
 * of read_sample, and uses or sends the values in place of write_estimate. */
#include <stdio.h>
#include <stdlib.h>

#include "terragrip_settings.h"

static union { /* aligned as a double; of the policy that the settings name, it may be smaller: tg_estimator_size */
    double align;
    unsigned char bytes[TG_ESTIMATOR_ROOM];
} storage;

static const int sensors[] = {TERRAGRIP_IN_PLACES};

/* A row: the time, then the columns TERRAGRIP_IN_NAMES; an empty cell was not measured. Returns 0 at the end. */
static int read_sample(tg_sample *sample)
{
    char line[4096], *cell = line;
    if (!fgets(line, sizeof line, stdin)) return 0;
    for (size_t k = 0; k < sizeof sample->value / sizeof *sample->value; k++) sample->value[k] = (tg_real)NAN;
    sample->time = strtod(cell, &cell);
    for (int k = 0; k < IN_COUNT && *cell == ','; k++) {
        char *const begin = cell + 1;
        const double value = strtod(begin, &cell);
        if (cell != begin) sample->value[sensors[k]] = (tg_real)value;
    }
    return 1;
}

static void write_estimate(const tg_estimate *estimate)
{
    static const int results[] = {TERRAGRIP_OUT_PLACES};
    printf("%.17g,%d", estimate->time, (int)estimate->event);
    for (int k = 0; k < OUT_COUNT; k++) printf(",%.17g", (double)estimate->value[results[k]]);
    printf("\n");
}

int main(void)
{
    static const char *const names[] = {TERRAGRIP_OUT_NAMES};
    tg_estimator *const estimator = (tg_estimator *)(void *)storage.bytes;
    tg_sample sample;
    tg_estimate estimate;
    if (tg_estimator_init(estimator, &terragrip_settings) != TG_OK) return 1;
    printf("time,event");
    for (int k = 0; k < OUT_COUNT; k++) printf(",%s", names[k]);
    printf("\n");
    while (read_sample(&sample)) /* a sample that is refused (infinite, or not later than the last) changes nothing */
        if (tg_estimator_update(estimator, &sample, &estimate) == TG_OK) write_estimate(&estimate);
    return 0;
}
