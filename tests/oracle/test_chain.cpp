/** @file
 *  Holds the library against the oracle from a sensor's trigger to a verdict: trigger and hold, decision, whole detectors, banks of certificates.
 *  Built twice, for float32 and float64. HULLGUARD_SEED repeats a run. */
#include "tables.hpp"

#include <memory>
#include <optional>

extern "C" {
#include "hullguard/bank.h"
#include "hullguard/decision.h"
#include "hullguard/detector.h"
#include "hullguard/hold.h"
#include "hullguard/trigger.h"
}

namespace {

using namespace problem;

/* ---- c) Trigger and hold ---- */

/* A group in both shapes: the oracle's, and the library's tables. */
struct Group {
    oracle::Receiver           model; /* its numbers are those of the tables, exactly */
    std::vector<std::uint8_t>  silence;
    std::vector<std::uint16_t> delta;
    std::vector<std::int32_t>  sigma, activity, zero;
    std::vector<hg_code_scale> scale;
    Reals                      half, slew, span, middle;
    std::vector<double>        step; /* largest change of the walk in a sample */
    hg_trigger_config          trigger{};
    hg_hold_config             hold{};

    Group(Random &random, bool extreme);
    Group(Random &random, const oracle::Table &course); /* [sample][channel]: what the signals will do, so that the slew holds */
    Group(const Group &) = delete;
    Group &operator=(const Group &) = delete;
    size_t width() const { return zero.size(); }

private:
    void draw_trigger(Random &random, int width, bool extreme);
    void draw_signals(Random &random, bool extreme);
    void add_scale(double resolution, double offset, std::int64_t low, std::int64_t high);
    void measure_signals(Random &random, const oracle::Table &course);
    void draw_activity(Random &random, bool extreme);
    void connect();
};

void Group::draw_trigger(Random &random, int width, bool extreme)
{
    oracle::Trigger &t = model.trigger;
    const int levels = random.whole(1, 8);
    t.interval_max = random.chance(0.1) ? 1 : random.whole(2, 30);
    int least = 255;
    for (int l = 0; l < levels; ++l) {
        t.silence.push_back(random.chance(0.3) ? 0 : random.whole(0, t.interval_max - 1));
        least = std::min(least, t.silence.back());
    }
    /* a counter of 16 hides 16 frames: the design refuses unless 16 (h_min + 1) > interval_max + margin (platoon, section 4) */
    t.interval_max = std::min(t.interval_max, 16 * (least + 1) - 1);
    for (int &h : t.silence) { h = std::min(h, t.interval_max - 1); }
    least = *std::min_element(t.silence.begin(), t.silence.end());
    t.interval_max = std::min(t.interval_max, 16 * (least + 1) - 1);
    model.margin   = random.whole(0, std::min(6, 16 * (least + 1) - 1 - t.interval_max));
    for (int l = 0; l < levels; ++l) {
        std::vector<double> d, s;
        for (int g = 0; g < width; ++g) {
            d.push_back(random.chance(0.3) ? 0 : random.chance(0.7) ? random.whole(0, 6000) : random.whole(0, 65535));
            s.push_back(random.chance(0.2) ? 0 : (extreme && random.chance(0.5)) ? static_cast<double>(random.integer(0, INT32_MAX)) : random.whole(0, 200));
        }
        t.delta.push_back(d);
        t.sigma.push_back(s);
    }
}

void Group::draw_activity(Random &random, bool extreme)
{
    oracle::Trigger    &t = model.trigger;
    std::vector<double> row(t.zero.size(), 0.0);
    for (int l = 0; l < t.levels(); ++l) {
        t.activity.push_back(row);
        for (double &a : row) { a = std::min(a + (extreme ? static_cast<double>(random.integer(1, INT32_MAX / 10)) : random.whole(1, 150)), 2147483647.0); }
    }
}

/* Scale, half, span and middle of one more channel. */
void Group::add_scale(double resolution, double offset, std::int64_t low, std::int64_t high)
{
    const oracle::Scale s{resolution, offset, static_cast<double>(low), static_cast<double>(high)};
    model.scale.push_back(s);
    scale.push_back({nearest(resolution), nearest(offset), nearest(1.0 / resolution), 0, static_cast<std::int32_t>(low), static_cast<std::int32_t>(high)});
    const double far  = std::max(std::abs(oracle::decode(s, s.minimum)), std::abs(oracle::decode(s, s.maximum))) + std::abs(offset);
    const double wide = resolution * (s.maximum - s.minimum);
    /* code.h: float32 moves the nearest code by 2^-22 |code|; a few units more for encoding and decoding */
    half.push_back(round_up(0.5 * resolution + far * (std::ldexp(1.0, -22) * (sizeof(hg_real) == 4) + 16.0 * unit)));
    span.push_back(round_up(wide + 2.0 * static_cast<double>(half.back())));
    middle.push_back(nearest(0.5 * (oracle::decode(s, s.minimum) + oracle::decode(s, s.maximum))));
    model.half.push_back(static_cast<double>(half.back()));
    model.span.push_back(static_cast<double>(span.back()));
    model.middle.push_back(static_cast<double>(middle.back()));
}

void Group::draw_signals(Random &random, bool extreme)
{
    const size_t rows = static_cast<size_t>(model.trigger.interval_max + model.margin);
    const size_t width = model.trigger.delta[0].size();
    model.slew.assign(rows, std::vector<double>(width));
    for (size_t g = 0; g < width; ++g) {
        const double resolution = static_cast<double>(nearest(std::pow(10.0, random.real(-4.0, 1.0))));
        const double offset     = static_cast<double>(nearest(resolution * random.real(-5000.0, 5000.0)));
        add_scale(resolution, offset, extreme ? random.integer(-INT32_MAX, 0) : random.integer(-32768, 0),
                  extreme ? random.integer(1, INT32_MAX) : random.integer(10, 32767));
        const double wide = resolution * (model.scale[g].maximum - model.scale[g].minimum);
        step.push_back(random.chance(0.5) ? resolution * random.real(0.0, 60.0) : wide * random.real(0.0, 0.2));
        for (size_t j = 0; j < rows; ++j) {
            model.slew[j][g] = std::min(model.span[g], static_cast<double>(round_up(step.back() * static_cast<double>(j + 1) + model.half[g])));
        }
        model.trigger.zero.push_back(random.chance(0.5) ? 0.0 : extreme ? static_cast<double>(random.integer(-INT32_MAX, INT32_MAX)) : random.whole(-9000, 9000));
    }
}

/* Range and slew as the course shows them. */
void Group::measure_signals(Random &random, const oracle::Table &course)
{
    const size_t rows = static_cast<size_t>(model.trigger.interval_max + model.margin);
    const size_t width = course[0].size();
    model.slew.assign(rows, std::vector<double>(width));
    for (size_t g = 0; g < width; ++g) {
        double far = 1e-3;
        for (const auto &row : course) { far = std::max(far, std::abs(row[g])); }
        const auto codes = random.integer(1000, 30000);
        add_scale(static_cast<double>(nearest(1.01 * far / static_cast<double>(codes))), 0.0, -codes, codes);
        for (size_t j = 0; j < rows; ++j) {
            double most = 0.0;
            for (size_t k = j + 1; k < course.size(); ++k) { most = std::max(most, std::abs(course[k][g] - course[k - j - 1][g])); }
            model.slew[j][g] = std::min(model.span[g], static_cast<double>(round_up(most + model.half[g])));
        }
        model.trigger.zero.push_back(0.0);
    }
}

void Group::connect()
{
    const oracle::Trigger &t = model.trigger;
    for (int h : t.silence) { silence.push_back(static_cast<std::uint8_t>(h)); }
    for (size_t l = 0; l < t.silence.size(); ++l) {
        for (size_t g = 0; g < t.zero.size(); ++g) {
            delta.push_back(static_cast<std::uint16_t>(t.delta[l][g]));
            sigma.push_back(static_cast<std::int32_t>(t.sigma[l][g]));
            activity.push_back(static_cast<std::int32_t>(t.activity[l][g]));
        }
    }
    for (double z : t.zero) { zero.push_back(static_cast<std::int32_t>(z)); }
    for (const auto &row : model.slew) {
        for (double s : row) { slew.push_back(nearest(s)); }
    }
    trigger = {static_cast<std::uint8_t>(zero.size()), static_cast<std::uint8_t>(silence.size()), static_cast<std::uint8_t>(t.interval_max),
               silence.data(), delta.data(), sigma.data(), activity.data(), zero.data()};
    hold = {&trigger, static_cast<std::uint8_t>(model.margin), scale.data(), half.data(), slew.data(), span.data(), middle.data()};
}

Group::Group(Random &random, bool extreme)
{
    draw_trigger(random, random.chance(0.03) ? 0 : random.whole(1, 6), extreme);
    draw_signals(random, extreme);
    draw_activity(random, extreme);
    connect();
}

Group::Group(Random &random, const oracle::Table &course)
{
    draw_trigger(random, static_cast<int>(course[0].size()), false);
    measure_signals(random, course);
    draw_activity(random, false);
    connect();
}

std::int32_t to_library(const oracle::Code &code) { return code ? static_cast<std::int32_t>(*code) : HG_CODE_INVALID; }
oracle::Code from_library(std::int32_t code) { return code == HG_CODE_INVALID ? oracle::Code() : oracle::Code(static_cast<double>(code)); }

/* Codes that wander, jump, and vanish; not bound to any slew. */
std::string one_trigger(Random &random, long &frames)
{
    const bool  extreme = random.chance(0.3);
    const Group group(random, extreme);
    const size_t w = group.width();
    if (!hg_trigger_valid(&group.trigger)) { return "valid tables refused"; }
    hg_trigger                self{};
    std::vector<std::int32_t> memory(w + 1), code(w + 1, 0);
    if (hg_trigger_start(&self, &group.trigger, memory.data()) != HG_OK) { return "start refused"; }
    oracle::Sender sender(group.model.trigger);
    const double   vanish = random.chance(0.5) ? 0.0 : 0.05;
    oracle::Codes  now(w);
    std::vector<double> last(w, 0.0);
    for (int k = 0; k < 200; ++k) {
        for (size_t g = 0; g < w; ++g) {
            const oracle::Scale &s = group.model.scale[g];
            const double reach = random.chance(0.1) ? (s.maximum - s.minimum) : random.chance(0.5) ? 0.0 : random.real(0.0, 200.0);
            last[g] = std::clamp(std::round(last[g] + random.real(-reach, reach)), s.minimum, s.maximum);
            now[g]  = random.chance(vanish) ? oracle::Code() : oracle::Code(last[g]);
            code[g] = to_library(now[g]);
        }
        const bool speaks = sender.step(now);
        frames += speaks;
        if ((hg_trigger_step(&self, code.data()) == HG_OK) != speaks) { return say("k %d: the oracle says %s", k, speaks ? "send" : "silence"); }
    }
    return {};
}

void test_trigger(void **)
{
    Random      random = stream(4);
    std::string failure;
    long        frames = 0;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_trigger(random, frames);
        if (!failure.empty()) { failure = say("group %d: ", i) + failure; }
    }
    std::printf("trigger: %.1f %% of the samples sent\n", 100.0 * static_cast<double>(frames) / (200.0 * problems));
    expect_clean(failure);
}

/* Sender, lossy bus and receiver of one group. */
class Link {
public:
    Link(Random &random, const Group &group, int quiet_from)
        : random_(random), group_(group), quiet_from_(quiet_from), hold_(group.model), sender_memory_(group.width() + 1), memory_(HG_HOLD_CODES(group.width()) + 1),
          reals_(HG_HOLD_REALS(group.width()) + 1),
          y_(group.width()), loss_(random.chance(0.3) ? 0.0 : random.real(0.0, 0.5)), known_(random.real(0.0, 1.0)),
          spurious_(random.chance(0.7) ? 0.0 : 0.03), vanish_(random.chance(0.7) ? 0.0 : 0.03), longest_outage_(random.chance(0.2) ? 200 : 12)
    {
        for (size_t g = 0; g < y_.size(); ++g) { y_[g] = static_cast<double>(group.middle[g]); }
    }
    std::string run(int samples);

    long frames = 0, lost_frames = 0, rewinds = 0, doubts = 0;

private:
    void        walk();
    std::string exchange(int k);
    std::string compare(int k);
    std::string sound() const;

    Random                   &random_;
    const Group              &group_;
    int                       quiet_from_; /* no loss from this sample on, so that the end is known */
    oracle::Hold              hold_;
    hg_trigger                trigger_{};
    hg_hold                   self_{};
    std::vector<std::int32_t> sender_memory_, memory_;
    std::vector<hg_real>      reals_;
    std::vector<double>       y_;
    oracle::Table             truth_, value_, radius_; /* [sample][channel]; the library's, rewritten as it says */
    double                    loss_, known_, spurious_, vanish_;
    int                       longest_outage_, outage_ = 0, pace_ = 0;
    unsigned                  counter_ = 0, expected_ = 0;
    long                      last_good_ = -1;
    std::vector<double>       drift_;
};

/* Rest, ramps and noise, never faster than the slew table allows, never outside the range. */
void Link::walk()
{
    if (drift_.empty() || random_.chance(0.05)) {
        pace_ = random_.whole(0, 2);
        drift_.clear();
        for (size_t g = 0; g < y_.size(); ++g) { drift_.push_back(random_.chance(0.5) ? 1.0 : -1.0); }
    }
    for (size_t g = 0; g < y_.size(); ++g) {
        const oracle::Scale &s = group_.model.scale[g];
        const double move = pace_ == 0 ? 0.05 * random_.real(-1.0, 1.0) : pace_ == 1 ? drift_[g] : random_.real(-1.0, 1.0);
        y_[g] = std::clamp(y_[g] + move * group_.step[g], oracle::decode(s, s.minimum), oracle::decode(s, s.maximum));
    }
    truth_.push_back(y_);
}

/* One sample of sender and bus, the same for both receivers. */
std::string Link::exchange(int k)
{
    std::vector<std::int32_t> code(group_.width() + 1, 0);
    oracle::Codes             codes(group_.width());
    for (size_t g = 0; g < group_.width(); ++g) {
        const bool vanished = random_.chance(vanish_);
        code[g]  = hg_code_encode(&group_.scale[g], vanished ? std::numeric_limits<hg_real>::quiet_NaN() : nearest(y_[g]));
        codes[g] = from_library(code[g]);
        const oracle::Scale &s = group_.model.scale[g];
        if (vanished && codes[g]) { return "NaN has a code"; }
        if (codes[g] && !(std::abs(oracle::decode(s, *codes[g]) - y_[g]) <= static_cast<double>(group_.half[g]))) {
            return say("k %d: code %.0f of %.17g is off by more than half", k, *codes[g], y_[g]);
        }
    }
    const bool quiet = k >= quiet_from_;
    if (quiet) { outage_ = 0; }
    if (!quiet && random_.chance(spurious_)) { /* a damaged frame that was none of this sender's */
        hold_.lose();
        hg_hold_lose(&self_);
    }
    if (!quiet && outage_ == 0 && random_.chance(0.01)) { outage_ = random_.whole(1, longest_outage_); }
    if (hg_trigger_step(&trigger_, code.data()) == HG_OK) {
        const unsigned counter = counter_++ % 16U;
        const bool     lost    = !quiet && (outage_ > 0 || random_.chance(loss_));
        ++frames;
        if (lost) {
            ++lost_frames;
            if (random_.chance(known_)) {
                hold_.lose();
                hg_hold_lose(&self_);
            }
        } else {
            const bool continues = last_good_ < 0 ? random_.chance(0.5) : counter == expected_;
            expected_  = (counter + 1U) % 16U;
            last_good_ = k;
            hold_.receive({codes, continues});
            if (hg_hold_receive(&self_, code.data(), continues) != HG_OK) { return say("k %d: a frame refused", k); }
            if (random_.chance(0.05) && hg_hold_receive(&self_, code.data(), false) != HG_E_REPEATED) { return say("k %d: a second frame taken", k); }
            if (!quiet && random_.chance(spurious_)) {
                hold_.lose();
                hg_hold_lose(&self_);
            }
        }
    }
    outage_ = std::max(0, outage_ - 1);
    return {};
}

/* Step both receivers; the whole past must agree as it is known now, rewritten or not. */
std::string Link::compare(int k)
{
    const size_t w = group_.width();
    Reals        value(w + 1), radius(w + 1), past(w + 1);
    std::uint8_t rewind = 0;
    hold_.step();
    hg_hold_step(&self_, value.data(), radius.data(), &rewind);
    value_.emplace_back(value.begin(), value.end() - 1);
    radius_.emplace_back(radius.begin(), radius.end() - 1);
    for (int lag = 1; lag <= rewind; ++lag) {
        hg_hold_past(&self_, static_cast<std::uint8_t>(lag), past.data());
        if (lag <= k) { radius_[static_cast<size_t>(k - lag)].assign(past.begin(), past.end() - 1); }
    }
    rewinds += hold_.rewound();
    doubts  += hold_.doubt();
    const int from = (hold_.rewound() || rewind > 0) ? 0 : k;
    for (int j = from; j <= k; ++j) {
        for (size_t g = 0; g < w; ++g) {
            const oracle::Scale &s = group_.model.scale[g];
            const size_t at    = static_cast<size_t>(j);
            const double v     = hold_.values()[at][g], r = hold_.radii()[at][g];
            const double v_tol = 4.0 * unit * (std::abs(s.offset) + std::abs(v - s.offset)); /* one product, one sum */
            if (!(std::abs(value_[at][g] - v) <= v_tol)) { return say("k %d, sample %d: value %.17g, oracle %.17g", k, j, value_[at][g], v); }
            if (!(std::abs(radius_[at][g] - r) <= 4.0 * unit * r)) {
                return say("k %d, sample %d, channel %zu: radius %.17g, oracle %.17g (rewind %d, oracle %d, last frame %ld, half %g, span %g)", k, j, g,
                           radius_[at][g], r, rewind, hold_.rewound(), last_good_, group_.model.half[g], group_.model.span[g]);
            }
        }
    }
    if (hg_hold_doubt(&self_) != hold_.doubt()) { return say("k %d: doubt %d, oracle %d, last frame %ld", k, hg_hold_doubt(&self_), hold_.doubt(), last_good_); }
    if (static_cast<int>(hg_hold_health(&self_)) != static_cast<int>(hold_.health())) {
        return say("k %d: health %d, oracle %d, last frame %ld", k, static_cast<int>(hg_hold_health(&self_)), static_cast<int>(hold_.health()), last_good_);
    }
    return {};
}

/* The one promise that matters: |true - value| <= radius, once the frame after a sample has settled it. */
std::string Link::sound() const
{
    for (size_t k = 0; k <= static_cast<size_t>(last_good_); ++k) {
        for (size_t g = 0; g < group_.width(); ++g) {
            if (!(std::abs(truth_[k][g] - value_[k][g]) <= radius_[k][g])) {
                return say("sample %zu, channel %zu: |%.17g - %.17g| > %.17g", k, g, truth_[k][g], value_[k][g], radius_[k][g]);
            }
        }
    }
    return {};
}

std::string Link::run(int samples)
{
    std::string failure;
    if (hg_trigger_start(&trigger_, &group_.trigger, sender_memory_.data()) != HG_OK) { return "sender refused"; }
    if (hg_hold_start(&self_, &group_.hold, memory_.data(), reals_.data()) != HG_OK) { return "hold refused"; }
    for (int k = 0; k < samples && failure.empty(); ++k) {
        walk();
        failure = exchange(k);
        if (failure.empty()) { failure = compare(k); }
    }
    return failure.empty() ? sound() : failure;
}

void test_hold(void **)
{
    Random      random = stream(5);
    std::string failure;
    long        frames = 0, lost = 0, rewinds = 0, doubts = 0;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        const Group group(random, random.chance(0.1));
        Link        link(random, group, 400);
        failure = link.run(400 + 2 * group.trigger.interval_max + 2);
        if (!failure.empty()) { failure = say("group %d (width %zu, levels %d, interval_max %d, margin %d): ", i, group.width(), group.trigger.levels,
                                              group.trigger.interval_max, group.hold.margin) + failure; }
        frames += link.frames;
        lost += link.lost_frames;
        rewinds += link.rewinds;
        doubts += link.doubts;
    }
    std::printf("hold: %ld frames, %ld lost, %ld rewinds, %ld samples in doubt\n", frames, lost, rewinds, doubts);
    expect_clean(failure);
}

/* ---- d) The decision ---- */

/* Evidence as a bus can bring it: doubt lasts until the group's next frame, and only that frame can rewind. */
class Witness {
public:
    Witness(Random &random, int groups, int generators) : random_(random), groups_(groups), generators_(generators) {}
    oracle::Evidence next()
    {
        oracle::Evidence e;
        if (random_.chance(0.05)) { calm_ = random_.real(0.0, 1.0); }
        if (random_.chance(0.1)) { ready_ = random_.chance(0.8); }
        for (int i = 0; i < groups_; ++i) {
            const unsigned bit = 1U << i;
            if (random_.chance(0.35)) { /* a frame */
                if (random_.chance((doubt_ & bit) != 0 ? 0.3 : 0.02)) { e.rewound |= bit; }
                doubt_ &= ~bit;
            } else if (random_.chance(0.6)) {
                doubt_ |= bit;
            }
        }
        e.doubt = doubt_;
        e.ready = ready_;
        for (int g = 0; g < generators_; ++g) { e.alarm.push_back(random_.chance(calm_)); }
        return e;
    }

private:
    Random  &random_;
    int      groups_, generators_;
    double   calm_  = 0.3;
    bool     ready_ = false;
    unsigned doubt_ = 0;
};

std::string one_decision(Random &random, std::vector<long> &seen)
{
    const int     groups = random.whole(1, 8), generators = random.whole(1, random.chance(0.2) ? HG_GENERATORS_MAX : 4);
    oracle::Rules rules;
    std::vector<std::uint8_t> feeds;
    for (int g = 0; g < generators; ++g) {
        rules.feeds.push_back(static_cast<unsigned>(random.integer(0, (1 << groups) - 1)));
        rules.faults.push_back(static_cast<std::uint32_t>(random.integer(0, 0xFFFFFFFFLL)));
        feeds.push_back(static_cast<std::uint8_t>(rules.feeds.back()));
    }
    rules.up    = random.chance(0.5) ? 1 : random.whole(1, 6);
    rules.down  = random.chance(0.3) ? 1 : random.whole(1, 10);
    rules.latch = random.chance(0.2);
    const hg_decision_config config{static_cast<std::uint8_t>(generators), feeds.data(), rules.faults.data(), static_cast<std::uint8_t>(rules.up),
                                    static_cast<std::uint8_t>(rules.down), rules.latch};
    std::vector<hg_alarm> memory(static_cast<size_t>(generators));
    hg_decision           self{};
    if (hg_decision_start(&self, &config, memory.data()) != HG_OK) { return "start refused"; }
    oracle::Decision decision(rules);
    Witness          witness(random, groups, generators);
    for (int k = 0; k < 300; ++k) {
        if (random.chance(0.003)) {
            hg_decision_reset(&self);
            decision.reset();
        }
        const oracle::Evidence e = witness.next();
        hg_evidence            evidence{0, e.ready, static_cast<std::uint8_t>(e.doubt), static_cast<std::uint8_t>(e.rewound)};
        for (size_t g = 0; g < e.alarm.size(); ++g) { evidence.alarm |= e.alarm[g] ? (1U << g) : 0U; }
        std::uint32_t       candidates = 0;
        const hg_plant      plant    = hg_decision_step(&self, &evidence, &candidates);
        const oracle::State expected = decision.step(e);
        ++seen[static_cast<size_t>(expected)];
        if (static_cast<int>(plant) != static_cast<int>(expected)) {
            return say("k %d (up %d, down %d, latch %d, generators %d, feeds %x): plant %d, oracle %d; alarm %x ready %d doubt %x rewound %x", k, rules.up, rules.down,
                       rules.latch, generators, rules.feeds[0], static_cast<int>(plant), static_cast<int>(expected), evidence.alarm, evidence.ready,
                       evidence.doubt, evidence.rewound);
        }
        if (candidates != decision.candidates()) {
            return say("k %d (up %d, down %d, latch %d, generators %d): candidates %x, oracle %x; plant %d alarm %x ready %d doubt %x rewound %x", k, rules.up,
                       rules.down, rules.latch, generators, candidates, decision.candidates(), static_cast<int>(plant), evidence.alarm, evidence.ready,
                       evidence.doubt, evidence.rewound);
        }
    }
    return {};
}

void test_decision(void **)
{
    Random            random = stream(6);
    std::vector<long> seen(4, 0);
    std::string       failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_decision(random, seen);
        if (!failure.empty()) { failure = say("decision %d: ", i) + failure; }
    }
    std::printf("decision: %ld starting, %ld none, %ld provisional, %ld confirmed\n", seen[0], seen[1], seen[2], seen[3]);
    expect_clean(failure);
}

/* ---- The whole detector ---- */

/* A plant with one or two observers, its signals in random order in one to three groups, over a bus that loses frames. The oracle's holds,
 *  cascades and thresholds run beside hg_detector; and while there is no fault nothing may be confirmed, whatever the bus does. */
class Chain {
public:
    Chain(Random &random, long &confirmed);
    Chain(const Chain &) = delete;
    Chain &operator=(const Chain &) = delete;
    std::string run();

private:
    static constexpr int samples_ = 240, fault_ = 160; /* an actuator fault from this sample on */
    struct Observer {
        Loop                      loop;
        System                    system;
        Vector                    rounding;
        Tail                      tail;
        Matrix                    exact; /* bias by sample, of the start that this run has */
        Bias                      start;
        std::optional<oracle::Cascade> cascade;
        std::optional<oracle::Hull>    hull;
        std::optional<Residual>        residual;
        std::optional<HullTables>      tables;
    };
    void        drive();
    void        build_groups();
    void        build(Observer &o);
    void        connect();
    void        transmit(size_t group, int k);
    std::string judge(int k);
    double      handed_over(const Observer &o, int k, Eigen::Index i) const;
    std::string compare(Observer &o, size_t at, int k, bool &alarm) const;

    Random                            &random_;
    long                              &confirmed_;
    Loop                               first_;
    bool                               rest_;
    double                             loss_, known_;
    oracle::Table                      course_; /* [sample][column]: readings y, then u as it is measured */
    std::vector<std::uint8_t>          place_;  /* [column] in the signal vector */
    std::vector<std::unique_ptr<Group>>  groups_;
    std::vector<size_t>                  group_first_;
    std::vector<std::unique_ptr<oracle::Hold>> holds_;
    std::vector<hg_trigger>            senders_;
    std::vector<std::vector<std::int32_t>> sender_memory_;
    std::vector<unsigned>              counter_, expected_;
    std::vector<std::unique_ptr<Observer>> observers_;

    oracle::Rules                      rules_;
    std::optional<oracle::Decision>    decision_;
    std::vector<hg_hold_config>        hold_config_;
    std::vector<hg_residual_config>    residual_config_;
    std::vector<hg_hull_config>        hull_config_;
    std::vector<std::uint8_t>          feeds_;
    std::vector<hg_hold>               hold_memory_;
    std::vector<hg_residual>           residual_memory_;
    std::vector<hg_hull>               hull_memory_;
    std::vector<hg_alarm>              alarm_memory_;
    std::vector<std::int32_t>          code_memory_;
    Reals                              real_memory_;
    hg_detector_config                 config_{};
    hg_detector                        self_{};
};

Chain::Chain(Random &random, long &confirmed)
    : random_(random), confirmed_(confirmed), first_(random_loop(random)), rest_(random.chance(0.5)), loss_(random.real(0.0, 0.4)),
      known_(random.real(0.0, 1.0))
{
    drive();
    build_groups();
    for (int i = random.whole(1, 2); i > 0; --i) {
        observers_.push_back(std::make_unique<Observer>());
        observers_.back()->loop = first_;
        if (i == 2) { draw_observer(random, observers_.back()->loop); }
        build(*observers_.back());
    }
    connect();
}

/* Manoeuvres: steps of the input, disturbances and noise within their bounds, an actuator fault at the end. */
void Chain::drive()
{
    const oracle::Plant &p = first_.plant;
    const Eigen::Index   m = p.C.rows(), inputs = p.B.cols();
    Vector x = first_.initial, u = Vector::Zero(inputs), fault = 2.0 * random_.matrix(inputs, 1);
    if (!rest_) { x *= 2.0; }
    for (Eigen::Index i = 0; i < x.size(); ++i) { x(i) *= random_.real(-1.0, 1.0); }
    for (int k = 0; k < samples_; ++k) {
        if (random_.chance(0.05)) { u = random_.matrix(inputs, 1); }
        const Vector d = random_.matrix(p.Ed.cols(), 1), real_u = (k >= fault_) ? Vector(u + fault) : u;
        const Vector y = p.C * x + p.D * real_u + p.Fd * d;
        x = p.A * x + p.B * real_u + p.Ed * d;
        std::vector<double> row(y.data(), y.data() + m);
        row.insert(row.end(), u.data(), u.data() + inputs);
        course_.push_back(row);
    }
}

void Chain::build_groups()
{
    const auto width = static_cast<Eigen::Index>(course_[0].size());
    place_ = random_places(random_, width, width);
    const int count = random_.whole(1, std::min(3, static_cast<int>(width)));
    size_t    first = 0;
    for (int i = 0; i < count; ++i) {
        const size_t after = (i == count - 1) ? place_.size() : first + 1 + static_cast<size_t>(random_.whole(0, static_cast<int>(place_.size() - first) - (count - i)));
        oracle::Table part(course_.size());
        for (size_t k = 0; k < course_.size(); ++k) {
            for (size_t at = first; at < after; ++at) {
                const auto column = std::find(place_.begin(), place_.end(), static_cast<std::uint8_t>(at)) - place_.begin();
                part[k].push_back(course_[k][static_cast<size_t>(column)]);
            }
        }
        groups_.push_back(std::make_unique<Group>(random_, part));
        holds_.push_back(std::make_unique<oracle::Hold>(groups_.back()->model));
        group_first_.push_back(first);
        first = after;
    }
}

/* What a tail must hold before sample `settle`, so that it and `later` together are never below `bias` (samples x residuals). */
Vector left_of(const Matrix &bias, const Vector &later, const Tail &tail, int settle)
{
    Vector left = Vector::Zero(later.size());
    for (Eigen::Index k = settle; k < bias.rows(); ++k) {
        for (Eigen::Index i = 0; i < later.size(); ++i) {
            const double above = bias(k, i) - later(i);
            left(i) = (above > 0.0) ? std::max(left(i), above / std::pow(tail.decay(i), k - settle + 1)) : left(i);
        }
    }
    return left;
}

/* Tables of one generator: bias by the error system, a rounding bound for values up to three times the readings, taps of each signal that reach
 *  back as far as its hold can rewrite. */
void Chain::build(Observer &o)
{
    Vector in_max = Vector::Zero(static_cast<Eigen::Index>(place_.size())), z_max = Vector::Zero(o.loop.generator.G.rows());
    oracle::Cascade run(o.loop.generator);
    const Eigen::Index m = o.loop.generator.V.cols();
    for (const auto &row : course_) {
        const Vector in = Eigen::Map<const Vector>(row.data(), static_cast<Eigen::Index>(row.size()));
        in_max = in_max.cwiseMax(in.cwiseAbs());
        run.step(in.head(m), in.tail(in.size() - m));
        z_max = z_max.cwiseMax((run.observer() + run.filter()).cwiseAbs());
    }
    o.system   = fused(o.loop.generator);
    o.rounding = rounding(o.system, m, 3.0 * z_max, 3.0 * in_max, unit);
    Taps taps;
    for (const std::uint8_t place : place_) {
        const auto after = std::upper_bound(group_first_.begin(), group_first_.end(), static_cast<size_t>(place));
        taps.push_back(random_.whole(groups_[static_cast<size_t>(after - group_first_.begin()) - 1]->trigger.interval_max - 1, 90));
    }
    o.tail = tail_of(random_, o.system, taps);
    Loop wide = o.loop;
    wide.initial *= 2.0; /* the state range */
    const int    settle = random_.whole(1, samples_ - 1);
    const Matrix rest = bias_by_error(o.loop, samples_ + 1), moving = bias_by_error(wide, samples_ + 1);
    const Vector later = moving.bottomRows(random_.whole(1, 40)).colwise().maxCoeff().transpose();
    o.exact = rest_ ? rest : moving;
    o.start = {rest.topRows(settle), moving.topRows(settle), left_of(rest, later, o.tail, settle), left_of(moving, later, o.tail, settle), later + o.rounding};
    o.start.rest.rowwise() += o.rounding.transpose();
    o.start.moving.rowwise() += o.rounding.transpose();
    o.residual.emplace(o.system, place_);
    o.tables.emplace(o.system, place_, taps, o.start, o.tail, 10, 10);
    if (!rest_) { o.loop = wide; }
    o.cascade.emplace(o.loop.generator);
    o.hull.emplace(o.loop.generator, o.loop.plant, o.loop.initial);
}

void Chain::connect()
{
    std::uint8_t history = 0;
    std::uint16_t residuals = 0;
    for (const auto &o : observers_) {
        residual_config_.push_back(o->residual->config);
        hull_config_.push_back(o->tables->config);
        history = std::max(history, static_cast<std::uint8_t>(*std::max_element(o->tables->taps.begin(), o->tables->taps.end()) + 1));
        residuals = static_cast<std::uint16_t>(residuals + o->residual->config.residuals);
        rules_.feeds.push_back((1U << groups_.size()) - 1U);
        rules_.faults.push_back(static_cast<std::uint32_t>(random_.integer(1, 255)));
        feeds_.push_back(static_cast<std::uint8_t>(rules_.feeds.back()));
    }
    rules_.down = random_.whole(1, 5);
    decision_.emplace(rules_);
    for (const auto &g : groups_) {
        hold_config_.push_back(g->hold);
        sender_memory_.emplace_back(g->width());
        senders_.emplace_back();
        hg_trigger_start(&senders_.back(), &g->trigger, sender_memory_.back().data());
    }
    counter_.assign(groups_.size(), 0U);
    expected_ = counter_;
    const auto signals = static_cast<std::uint8_t>(place_.size()), groups = static_cast<std::uint8_t>(groups_.size());
    const auto generators = static_cast<std::uint8_t>(observers_.size());
    config_.signals    = signals;
    config_.width      = signals; /* nothing is derived */
    config_.groups     = groups;
    config_.hold       = hold_config_.data();
    config_.generators = generators;
    config_.residual   = residual_config_.data();
    config_.hull       = hull_config_.data();
    config_.decision   = {generators, feeds_.data(), rules_.faults.data(), 1, static_cast<std::uint8_t>(rules_.down), false};
    config_.history    = history;
    config_.residuals  = residuals;
    config_.codes      = static_cast<std::uint16_t>(HG_HOLD_CODES(signals));
    config_.reals = hg_detector_reals(&config_);
    hold_memory_.resize(groups);
    residual_memory_.resize(generators);
    hull_memory_.resize(generators);
    alarm_memory_.resize(generators);
    code_memory_.resize(config_.codes);
    real_memory_.resize(config_.reals);
}

/* One group's sender and bus, the same frames for both sides. */
void Chain::transmit(size_t group, int k)
{
    const Group              &g = *groups_[group];
    std::vector<std::int32_t> code;
    oracle::Codes             codes;
    for (size_t c = 0; c < g.width(); ++c) {
        const auto column = std::find(place_.begin(), place_.end(), static_cast<std::uint8_t>(group_first_[group] + c)) - place_.begin();
        code.push_back(hg_code_encode(&g.scale[c], nearest(course_[static_cast<size_t>(k)][static_cast<size_t>(column)])));
        codes.push_back(from_library(code.back()));
    }
    if (hg_trigger_step(&senders_[group], code.data()) != HG_OK) { return; }
    const unsigned counter = counter_[group]++ % 16U;
    const auto     index   = static_cast<std::uint8_t>(group);
    if (random_.chance(loss_)) {
        if (random_.chance(known_)) {
            holds_[group]->lose();
            hg_detector_lose(&self_, index);
        }
        return;
    }
    const bool continues = counter == expected_[group];
    expected_[group] = (counter + 1U) % 16U;
    holds_[group]->receive({codes, continues});
    hg_detector_receive(&self_, index, code.data(), continues);
}

/* What table and tail say of the initial state and the disturbances beyond what they do. */
double Chain::handed_over(const Observer &o, int k, Eigen::Index i) const
{
    const int settle = static_cast<int>(o.start.rest.rows());
    if (k < settle) { return 0.0; }
    const double left = (rest_ ? o.start.rest_left : o.start.moving_left)(i) * std::pow(o.tail.decay(i), k - settle + 1);
    return o.start.later(i) - o.rounding(i) + left - o.exact(k, i);
}

/* r and J of one generator against the oracle's cascade and full-history hull over the radii as they are known now. */
std::string Chain::compare(Observer &o, size_t at, int k, bool &alarm) const
{
    const Eigen::Index  m = o.loop.generator.V.cols(), width = static_cast<Eigen::Index>(place_.size());
    std::vector<Vector> radius(static_cast<size_t>(k + 1), Vector(width)), y, u;
    Vector              value(width);
    double              widest = 0.0;
    for (Eigen::Index c = 0; c < width; ++c) {
        const size_t place = place_[static_cast<size_t>(c)];
        size_t       group = groups_.size() - 1;
        while (group_first_[group] > place) { --group; }
        value(c) = holds_[group]->value()[place - group_first_[group]];
        for (size_t j = 0; j <= static_cast<size_t>(k); ++j) {
            radius[j](c) = holds_[group]->radii()[j][place - group_first_[group]];
            widest       = std::max(widest, radius[j](c));
        }
    }
    for (const Vector &row : radius) {
        y.push_back(row.head(m));
        u.push_back(row.tail(width - m));
    }
    const Vector r = o.cascade->step(value.head(m), value.tail(width - m)), J = o.hull->threshold(y, u);
    for (Eigen::Index i = 0; i < r.size(); ++i) {
        const double lib_r = static_cast<double>(self_.r[at + static_cast<size_t>(i)]), lib_J = static_cast<double>(self_.J[at + static_cast<size_t>(i)]);
        const double tail  = o.tail.weight.row(i).sum() * widest / (1.0 - o.tail.decay(i)) + handed_over(o, k, i);
        if (!(std::abs(lib_r - r(i)) <= o.rounding(i) + 1e-12)) { return say("k %d: r %.17g, oracle %.17g", k, lib_r, r(i)); }
        if (!(lib_J >= J(i) * (1.0 - 1e-12))) { return say("k %d: J %.17g below the exact hull %.17g", k, lib_J, J(i)); }
        if (!(lib_J <= (J(i) + o.rounding(i) + 1.1 * tail) * 1.01)) { return say("k %d: J %.17g, exact %.17g, tail at most %g", k, lib_J, J(i), tail); }
        alarm = alarm || std::abs(lib_r) > lib_J; /* the library's numbers: a tie may fall either way within rounding */
    }
    return {};
}

std::string Chain::judge(int k)
{
    hg_finding finding{};
    if (hg_detector_step(&self_, &finding) != HG_OK) { return say("k %d: step refused", k); }
    oracle::Evidence evidence;
    evidence.ready = k + 1 >= 10;
    for (size_t g = 0; g < groups_.size(); ++g) {
        holds_[g]->step();
        evidence.doubt |= static_cast<unsigned>(holds_[g]->doubt()) << g;
        evidence.rewound |= static_cast<unsigned>(holds_[g]->rewound()) << g;
        if (static_cast<int>(hg_hold_health(&hold_memory_[g])) != static_cast<int>(holds_[g]->health())) { return say("k %d: health of group %zu", k, g); }
    }
    size_t at = 0;
    for (const auto &o : observers_) {
        bool              alarm = false;
        const std::string failure = compare(*o, at, k, alarm);
        if (!failure.empty()) { return failure; }
        evidence.alarm.push_back(alarm);
        at += o->residual->config.residuals;
    }
    const oracle::State state = decision_->step(evidence);
    if (k < fault_ && finding.plant == HG_PLANT_CONFIRMED) { return say("k %d: a false alarm is confirmed", k); }
    if (static_cast<int>(finding.plant) != static_cast<int>(state)) {
        return say("k %d (down %d): plant %d, oracle %d", k, rules_.down, static_cast<int>(finding.plant), static_cast<int>(state));
    }
    if (finding.candidates != decision_->candidates()) { return say("k %d: candidates %x, oracle %x", k, finding.candidates, decision_->candidates()); }
    confirmed_ += state == oracle::State::confirmed;
    return {};
}

std::string Chain::run()
{
    hg_detector_memory memory{};
    memory.hold     = hold_memory_.data();
    memory.residual = residual_memory_.data();
    memory.hull     = hull_memory_.data();
    memory.alarm    = alarm_memory_.data();
    memory.code     = code_memory_.data();
    memory.codes    = config_.codes;
    memory.real     = real_memory_.data();
    memory.reals    = config_.reals;
    if (hg_detector_start(&self_, &config_, &memory, rest_ ? HG_START_REST : HG_START_MOVING) != HG_OK) { return "start refused"; }
    std::string failure;
    for (int k = 0; k < samples_ && failure.empty(); ++k) {
        for (size_t g = 0; g < groups_.size(); ++g) { transmit(g, k); }
        failure = judge(k);
    }
    return failure;
}

void test_detector(void **)
{
    Random      random = stream(7);
    std::string failure;
    long        confirmed = 0;
    for (int i = 0; i < problems / 2 && failure.empty(); ++i) {
        Chain chain(random, confirmed);
        failure = chain.run();
        if (!failure.empty()) { failure = say("detector %d: ", i) + failure; }
    }
    std::printf("detector: %ld samples confirmed after the fault\n", confirmed);
    if (failure.empty() && confirmed == 0) { failure = "no fault was ever found"; }
    expect_clean(failure);
}

/* ---- e) A bank of certificates over rings whose past is rewritten ---- */

struct BankTables {
    std::vector<oracle::Certificate> certificates;
    std::vector<std::uint8_t>        signal, extra;
    Reals                            weight, extra_weight, bias;
    hg_bank_config                   config{};
    int                              values, radii;

    explicit BankTables(Random &random)
    {
        const int window = random.whole(1, 40), count = random.whole(1, 20), width = random.whole(1, 6), extras = random.whole(0, 3);
        values = width + random.whole(0, 3);
        radii  = values + extras + random.whole(0, 2);
        signal = random_places(random, width, values);
        if (extras > 0) { extra = random_places(random, extras, radii - values); }
        for (std::uint8_t &e : extra) { e = static_cast<std::uint8_t>(e + values); } /* derived signals come behind the sent ones */
        const double widen = static_cast<double>(round_up(random.chance(0.5) ? 1.0 : random.real(1.0, 1.5)));
        for (int c = 0; c < count; ++c) {
            certificates.push_back({Matrix::Zero(window, values), Matrix::Zero(window, radii), static_cast<double>(nearest(random.real(1e-3, 1.0)))});
            bias.push_back(nearest(certificates.back().bias));
        }
        for (int lag = 0; lag < window; ++lag) {
            fill(random, lag, signal, weight, [](oracle::Certificate &c) -> Matrix & { return c.weight; }, -1.0);
            fill(random, lag, extra, extra_weight, [](oracle::Certificate &c) -> Matrix & { return c.extra; }, 0.0);
        }
        config = {static_cast<std::uint8_t>(count), static_cast<std::uint8_t>(window), static_cast<std::uint8_t>(width), signal.data(), 0, weight.data(),
                  static_cast<std::uint8_t>(extras), extra.data(), extra_weight.data(), bias.data(), nearest(widen)};
    }

private:
    template <class Part> void fill(Random &random, int lag, const std::vector<std::uint8_t> &places, Reals &table, Part part, double least)
    {
        for (const std::uint8_t place : places) {
            for (oracle::Certificate &c : certificates) {
                const hg_real w = nearest(random.chance(0.2) ? 0.0 : random.real(least, 1.0));
                part(c)(lag, place) = static_cast<double>(w);
                table.push_back(w);
            }
        }
    }
};

struct BankCount {
    int alarms = 0, quiet = 0, empty = 0;
};

/* What the library says of one sample, held against every certificate. */
std::string judge_bank(const hg_bank &self, const oracle::Bank &bank, const BankTables &tables, double r, double J, BankCount &count)
{
    const double share = unit * (static_cast<double>(tables.config.window) * (tables.config.width + tables.config.extras + 1.0) + 8.0);
    const double own_r = bank.residual(self.closest), own_J = bank.threshold(self.closest);
    if (!(std::abs(r - own_r) <= share * bank.moved(self.closest))) { return say("certificate %d: r %.17g, oracle %.17g", self.closest, r, own_r); }
    if (!(std::abs(J - own_J) <= share * own_J)) { return say("certificate %d: J %.17g, oracle %.17g", self.closest, J, own_J); }
    const bool alarm = std::abs(r) > J;
    (alarm ? count.alarms : count.quiet)++;
    for (size_t c = 0; c < tables.certificates.size(); ++c) {
        const double other = std::abs(bank.residual(c)), limit = bank.threshold(c), slack = share * (bank.moved(c) + limit);
        if (!alarm && other > limit + slack) { return say("certificate %zu alarms, |r| %.17g > %.17g, the bank does not", c, other, limit); }
        if (alarm != (other > limit) && std::abs(other - limit) > slack) { continue; } /* the nearest is an alarm where there is one */
        if (other / limit > (std::abs(own_r) / own_J) * (1.0 + share) + 2.0 * slack / limit + 2.0 * share * bank.moved(self.closest) / own_J) {
            return say("certificate %zu has |r| / J %.17g, the bank chose %d with %.17g", c, other / limit, self.closest, std::abs(own_r) / own_J);
        }
    }
    return {};
}

std::string one_bank(Random &random, BankCount &count)
{
    const BankTables    tables(random);
    const int           length = tables.config.window + random.whole(0, 5);
    Reals               value_memory(static_cast<size_t>(tables.values * length)), radius_memory(static_cast<size_t>(tables.radii * length));
    std::vector<hg_acc> sums(HG_BANK_SUMS(tables.config.certificates));
    hg_ring             value{}, radius{};
    hg_bank             self{};
    const auto          values = static_cast<std::uint8_t>(tables.values), radii = static_cast<std::uint8_t>(tables.radii), rows = static_cast<std::uint8_t>(length);
    if (!hg_bank_valid(&tables.config, values, radii, rows) || hg_ring_start(&value, values, rows, value_memory.data()) != HG_OK ||
        hg_ring_start(&radius, radii, rows, radius_memory.data()) != HG_OK || hg_bank_start(&self, &tables.config, sums.data()) != HG_OK) {
        return "start refused";
    }
    oracle::Bank     bank(tables.certificates, static_cast<double>(tables.config.widen));
    const double     size = random.real(0.1, 4.0);
    std::vector<int> mode(static_cast<size_t>(tables.radii), 1);
    Reals            v(static_cast<size_t>(tables.values)), w(static_cast<size_t>(tables.radii));
    for (int k = 0; k < 120; ++k) {
        if (random.chance(0.01)) {
            hg_bank_reset(&self);
            bank.reset();
        }
        for (hg_real &x : v) { x = nearest(size * random.real(-1.0, 1.0)); }
        random_radii(random, w, mode);
        if (hg_ring_push(&value, v.data()) != HG_OK || hg_ring_push(&radius, w.data()) != HG_OK) { return "push refused"; }
        Vector held(tables.values), wide(tables.radii);
        for (Eigen::Index i = 0; i < held.size(); ++i) { held(i) = static_cast<double>(v[static_cast<size_t>(i)]); }
        for (Eigen::Index i = 0; i < wide.size(); ++i) { wide(i) = static_cast<double>(w[static_cast<size_t>(i)]); }
        bank.step(held, wide);
        for (int lag = 1; random.chance(0.05) && lag < length && lag < bank.samples(); ++lag) { /* the past turns out to be worse than thought */
            const int     place = random.whole(0, tables.radii - 1);
            const hg_real wider = nearest(random.real(0.0, 5.0));
            hg_ring_rewrite(&radius, static_cast<std::uint8_t>(lag), static_cast<std::uint8_t>(place), 1U, &wider);
            bank.radius(lag)(place) = static_cast<double>(wider);
        }
        hg_real         r = nearest(9.0), J = nearest(9.0);
        const hg_status status = hg_bank_step(&self, &value, &radius, &r, &J);
        if (hg_bank_ready(&self) != bank.ready() || (status == HG_OK) != bank.ready()) { return say("k %d: status %d, oracle ready %d", k, static_cast<int>(status), bank.ready()); }
        if (!bank.ready()) {
            ++count.empty;
            if (status != HG_E_EMPTY || std::abs(static_cast<double>(r)) > 0.0 || J != tables.bias[0]) { return say("k %d: output before the window is full", k); }
            continue;
        }
        const std::string wrong = judge_bank(self, bank, tables, static_cast<double>(r), static_cast<double>(J), count);
        if (!wrong.empty()) { return say("k %d: ", k) + wrong; }
    }
    return {};
}

void test_bank(void **)
{
    Random      random = stream(8);
    BankCount   count;
    std::string failure;
    for (int i = 0; i < problems / 5 && failure.empty(); ++i) {
        failure = one_bank(random, count);
        if (!failure.empty()) { failure = say("bank %d: ", i) + failure; }
    }
    std::printf("bank: %d alarms, %d samples without, %d with a window that is not full\n", count.alarms, count.quiet, count.empty);
    if (failure.empty() && std::min({count.alarms, count.quiet, count.empty}) < problems) { failure = "too few cases of a kind"; }
    expect_clean(failure);
}
} // namespace

int main()
{
    begin_run();
    const CMUnitTest tests[] = {
        cmocka_unit_test(test_trigger), cmocka_unit_test(test_hold), cmocka_unit_test(test_decision), cmocka_unit_test(test_detector),
        cmocka_unit_test(test_bank),
    };
    return cmocka_run_group_tests_name("chain", tests, nullptr, nullptr);
}
