/* Restoring from bytes that are not a snapshot, though their checksum fits: refused, or an estimator that runs. Meant for the build under
 * the address and the undefined-behaviour sanitizers (`make test-long`). */
#include "driven.h"
#include "fields.h"

enum { TRIALS = 400, ROWS = 200, AFTER = 40 };

static int restarts; /* rows at which a filter that lost its way began anew, and said so */

static void drive(tg_estimator *e, double from, int rows, int must)
{
    tg_sample sample;
    tg_estimate out;
    for (int row = 0; row < rows; row++) {
        sample = sample_of(row);
        sample.time = from + 0.01 * row;
        const tg_status status = tg_estimator_update(e, &sample, &out);
        restarts += status == TG_OK && out.event == TG_EVENT_RESTART;
        CHECK(!must || status == TG_OK, "row %d: %d", row, (int)status);
    }
}

static uint32_t word(void)
{
    const double kind = uniform(0, 1);
    if (kind < 0.3) return (uint32_t)uniform(0, 300);
    if (kind < 0.5) return 0u - (uint32_t)uniform(1, 300);
    return (uint32_t)uniform(0, 4294967295.0);
}

static int attack(tg_estimator *e, size_t room, const uint8_t *good, uint8_t *bytes, size_t size, size_t header, size_t reach, int words)
{
    memcpy(bytes, good, size);
    for (int k = 0; k < words; k++) {
        const uint32_t w = word();
        memcpy(bytes + header + 4 * (size_t)uniform(0, (double)(reach / 4 - 1)), &w, sizeof w);
    }
    seal_snapshot(bytes, size);
    if (tg_estimator_restore(e, room, bytes, size) != TG_OK) return 0;
    drive(e, 6.01, AFTER, 0);
    drive(e, 1e6, AFTER, 0);
    CHECK(tg_estimator_snapshot(e, bytes) == TG_OK, "snapshot");
    return 1;
}

/* Settings are made anew from the snapshot, so a comparison of estimators finds a missing one only where it is not 0: every byte but
 * padding, which is shorter than a real, must be in the table. */
static void settings_are_whole(void)
{
    tg_settings all, back;
    uint8_t bytes[sizeof all];
    memset(&all, 0xA5, sizeof all);
    memset(&back, 0, sizeof back);
    CHECK(tgi_fields_size(tgi_settings_fields) <= sizeof all, "more fields than settings");
    tgi_write_fields(tgi_settings_fields, &all, bytes);
    tgi_read_fields(tgi_settings_fields, &back, bytes);
    for (size_t k = 0, missing = 0; k < sizeof back; k++) {
        missing = ((const uint8_t *)&back)[k] ? 0 : missing + 1;
        CHECK(missing < (sizeof(tg_real) == 8 ? 8u : 1u), "settings at byte %d are not in the snapshot", (int)k);
    }
}

/* A count that grew with every row would leave its range within days, and the snapshot of a machine that never rests be refused. */
static void counts_stay_small(const tg_estimator *e)
{
    const int32_t policy = e->filter.tuning.policy;
    if (policy == TG_BANK) CHECK(e->filter.policy.bank.updates < e->filter.tuning.mix_stride, "updates of the bank");
    if (policy == TG_ADAPTIVE || policy == TG_SUPERVISED)
        CHECK(e->filter.policy.adaptive.adaptation.updates < e->filter.tuning.stride, "updates of the adaptation");
}

static void comes_back_whole(const tg_estimator *e, tg_estimator *other, size_t room, uint8_t *bytes)
{
    CHECK(tg_estimator_snapshot(e, bytes) == TG_OK, "snapshot");
    CHECK(tg_estimator_restore(other, room - 1, bytes, tg_snapshot_size(e)) == TG_BAD_ARGUMENT, "no room");
    CHECK(tg_estimator_restore(other, room, bytes, tg_snapshot_size(e)) == TG_OK, "a good one");
    CHECK(memcmp(e, other, room) == 0, "a field is not in the snapshot");
}

int main(void)
{
    const size_t header = 24;
    settings_are_whole();
    for (int method = 0; method < METHODS; method++) {
        const tg_settings s = settings_of(method);
        const size_t object = tg_estimator_size(s.tuning.policy); /* no byte more: what lies behind is watched by the sanitizer */
        tg_estimator *const e = calloc(1, object), *const other = calloc(1, object); /* padding is compared, and nobody writes it */
        uint8_t *const good = malloc(object), *const bytes = malloc(object);
        int passed = 0;
        CHECK(e && other && good && bytes, "memory");
        CHECK(tg_estimator_init(e, &s) == TG_OK, "init");
        const size_t size = tg_snapshot_size(e);
        CHECK(size < object, "room");
        drive(e, 0, ROWS, 1);
        counts_stay_small(e);
        comes_back_whole(e, other, object, good);
        drive(e, 6, 1, 1); /* after a gap */
        comes_back_whole(e, other, object, good);
        good[8] ^= 1;
        CHECK(tg_estimator_restore(other, object, good, size) == TG_BAD_SNAPSHOT, "another version");
        good[8] ^= 1;
        for (int trial = 0; trial < TRIALS; trial++)
            passed += attack(e, object, good, bytes, size, header, trial % 3 ? size - header - 8 : 6000, trial % 2 ? 1 : 40);
        printf("method %d, engine %d, policy %d: %d of %d changed snapshots refused, the others ran on\n", (int)s.method, (int)s.tuning.engine, (int)s.tuning.policy,
               TRIALS - passed, TRIALS);
        CHECK(passed > 0 && passed < TRIALS, "the trials tell nothing");
        free(e);
        free(other);
        free(good);
        free(bytes);
    }
    CHECK(restarts > 0, "a broken filter went on unflagged");
    return 0;
}
