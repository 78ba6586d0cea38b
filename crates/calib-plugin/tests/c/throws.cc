// A plugin in C++: what its code throws is caught before the border.
#include "calib_plugin.h"

#include <cstring>
#include <stdexcept>
#include <vector>

namespace {

double mean(const calib_motion &motion, int axis) {
    std::vector<double> values;
    for (std::size_t s = 0; s < motion.samples; ++s) {
        if (motion.seen[s]) values.push_back(motion.points_m[3 * s + static_cast<std::size_t>(axis)]);
    }
    double sum = values.at(0);  // Throws for no sample.
    for (std::size_t i = 1; i < values.size(); ++i) sum += values[i];
    return sum / static_cast<double>(values.size());
}

extern "C" calib_status fit(const calib_call *call, const calib_motion *motion, const calib_cor_sink *sink) {
    try {
        calib_cor_result result{};
        result.struct_size = sizeof result;
        for (int i = 0; i < 3; ++i) result.center_m[i] = mean(*motion, i);
        result.used = motion->samples;
        return sink->result(sink->context, &result);
    } catch (const std::out_of_range &) {
        return calib_say(call, CALIB_PANICKED, "std::out_of_range");
    } catch (...) {
        return calib_say(call, CALIB_PANICKED, "an exception");
    }
}

const calib_cor_1 table = {sizeof table, 0, fit};

calib_offer make_offer() {
    calib_offer offer{};
    offer.kind = CALIB_KIND_COR;
    offer.name = "mean";
    offer.summary = offer.source = "";
    offer.shapes = CALIB_TAKES_POINTS;
    return offer;
}
const calib_offer offers[] = {make_offer()};
const calib_descriptor descriptor = {sizeof descriptor, sizeof(calib_offer), "cpp", "1.0", "", "MIT", offers, 1};

extern "C" const calib_descriptor *describe() { return &descriptor; }
extern "C" const void *find(const char *kind, const char *name) {
    return std::strcmp(kind, CALIB_KIND_COR) == 0 && std::strcmp(name, "mean") == 0 ? &table : nullptr;
}

}  // namespace

const calib_entry calib_plugin_entry = {CALIB_ABI_MAJOR, CALIB_ABI_MINOR, sizeof(calib_entry), 0, describe, find};
