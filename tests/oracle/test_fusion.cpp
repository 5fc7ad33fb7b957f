/** @file
 *  Holds the fusion filter against an independent one on random systems: double precision, full matrices, and the longer way round: it remembers
 *  everything that was ever heard of every sample, and filters from the first sample on each time. Written from the method note (fusion, sections 3 and 5) and the
 *  text of fusion.h. Built twice, for float32 and float64. HULLGUARD_SEED repeats a run. */
#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <setjmp.h>
#include <string>
#include <vector>

extern "C" {
#include <cmocka.h>

#include "hullguard/fusion.h"
}

namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;
using Reals = std::vector<hg_real>;

constexpr int  systems = 400;
constexpr int  samples = 60;
constexpr bool narrow  = sizeof(hg_real) == 4;

class Random {
public:
    explicit Random(std::uint64_t seed) : engine_(seed) {}
    double real(double low, double high) { return low + (high - low) * std::ldexp(static_cast<double>(engine_() >> 11), -53); }
    int    whole(int low, int high) { return low + static_cast<int>(engine_() % static_cast<std::uint64_t>(high - low + 1)); }
    bool   chance(double p) { return real(0.0, 1.0) < p; }
    Matrix matrix(int rows, int cols)
    {
        return Matrix::NullaryExpr(rows, cols, [this]() { return static_cast<double>(static_cast<hg_real>(real(-1.0, 1.0))); });
    }

private:
    std::mt19937_64 engine_;
};

Reals row_major(const Matrix &m)
{
    Reals out;
    for (Eigen::Index i = 0; i < m.rows(); ++i) {
        for (Eigen::Index j = 0; j < m.cols(); ++j) {
            out.push_back(static_cast<hg_real>(m(i, j)));
        }
    }
    return out;
}

/* As the library has it. */
Matrix rounded(const Matrix &m) { return m.cast<hg_real>().cast<double>(); }

struct Table {
    std::uint16_t alive = 0;
    Vector        level, relax, early;
};

struct System {
    int                n = 1, m = 1, p = 0, depth = 0, delay = 0, heartbeat = 1, watchdog = 1;
    hg_fusion_trigger  trigger = HG_FUSION_INNOVATION;
    Matrix             A, B, Q, P0, C;
    Vector             x0, R;
    double             huber = 0.0;
    bool               selected = false;
    std::vector<std::uint8_t> place;
    std::vector<Table> table;
};

System random_system(Random &random)
{
    System s;
    s.n = random.whole(1, 6);
    s.m = random.whole(1, 5);
    s.p = random.whole(0, 2);
    s.depth = random.whole(0, 8);
    s.delay = random.whole(0, std::min(2, s.depth));
    s.heartbeat = random.whole(1, 12);
    s.watchdog = s.heartbeat + random.whole(0, 12);
    s.trigger = static_cast<hg_fusion_trigger>(random.whole(1, 5));
    s.A = random.matrix(s.n, s.n);
    const double radius = s.A.eigenvalues().cwiseAbs().maxCoeff();
    s.A = rounded(s.A * (random.real(0.3, 1.02) / std::max(radius, 0.1)));
    s.B = random.matrix(s.n, s.p);
    const Matrix q = random.matrix(s.n, s.n), p = random.matrix(s.n, s.n);
    s.Q = rounded(0.1 * q * q.transpose());
    s.P0 = rounded(p * p.transpose() + 0.1 * Matrix::Identity(s.n, s.n));
    s.x0 = random.matrix(s.n, 1);
    s.selected = random.chance(0.5);
    s.C = Matrix::Zero(s.m, s.n);
    s.R = Vector(s.m);
    for (int i = 0; i < s.m; ++i) {
        s.place.push_back(static_cast<std::uint8_t>(random.whole(0, s.n - 1)));
        s.C(i, s.place.back()) = 1.0;
        s.R(i) = static_cast<double>(static_cast<hg_real>(random.real(0.05, 1.0)));
    }
    if (!s.selected) {
        s.C = random.matrix(s.m, s.n);
    }
    s.huber = random.chance(0.5) ? static_cast<double>(static_cast<hg_real>(random.real(0.5, 3.0))) : 0.0;
    for (int t = 0; t < random.whole(1, 3); ++t) {
        Table table;
        table.alive = static_cast<std::uint16_t>((t == 0) ? (1 << s.m) - 1 : random.whole(0, (1 << s.m) - 1));
        table.level = rounded(random.matrix(s.m, 1).cwiseAbs() * 2.0 + Vector::Constant(s.m, 0.01));
        table.relax = rounded(random.matrix(s.m, 1) * 2.0);
        table.early = rounded(random.matrix(s.m, 1) * 4.0);
        s.table.push_back(table);
    }
    return s;
}

/* ---- the oracle ---- */

struct Heard {
    bool   value = false;
    double y = 0.0;
};

class Oracle {
public:
    explicit Oracle(const System &s) : s_(s) {}

    void open(const Vector &u)
    {
        u_.push_back(u);
        heard_.emplace_back(static_cast<std::size_t>(s_.m));
        pass();
    }
    void hear(int lag, int i, double y) { heard_[heard_.size() - 1U - static_cast<std::size_t>(lag)][static_cast<std::size_t>(i)] = Heard{true, y}; }
    void close() { closed_ = true; pass(); closed_ = false; }

    Vector x;
    Matrix P;
    Vector reference, variance;
    std::vector<bool> expected;
    bool tie = false; /* of the schedule, within rounding */
    std::vector<int>  age;
    double level(int i) const { return table_->level(i); }

private:
    struct Prior {
        Vector x;
        Matrix P;
        std::vector<int> age;
    };

    void step(const Vector &u, Vector &x_, Matrix &P_) const
    {
        x_ = (s_.A * x_ + s_.B * u).eval();
        P_ = (s_.A * P_ * s_.A.transpose() + s_.Q).eval();
    }

    void correct(Vector &x_, Matrix &P_, int i, double r, double R) const
    {
        const Eigen::RowVectorXd c = s_.C.row(i);
        const Vector K = P_ * c.transpose() / (c * P_ * c.transpose() + R);
        const Matrix L = Matrix::Identity(s_.n, s_.n) - K * c;
        x_ += K * r;
        P_ = (L * P_ * L.transpose() + R * K * K.transpose()).eval();
    }

    const Table &choose(const std::vector<int> &ages) const
    {
        std::uint16_t alive = 0;
        for (int i = 0; i < s_.m; ++i) {
            alive = static_cast<std::uint16_t>(alive | ((ages[static_cast<std::size_t>(i)] <= s_.watchdog) ? 1 << i : 0));
        }
        const Table *found = &s_.table.front();
        for (std::size_t t = 1; t < s_.table.size(); ++t) {
            found = (s_.table[t].alive == alive) ? &s_.table[t] : found;
        }
        return *found;
    }

    /* References of sample k, whose prior is the last of the list. */
    void refer(const std::vector<Prior> &prior, int k)
    {
        const int from = std::max(k - s_.delay, 0);
        Vector rx = prior[static_cast<std::size_t>(from)].x;
        Matrix rP = prior[static_cast<std::size_t>(from)].P;
        for (int j = from + 1; j <= k; ++j) {
            step(u_[static_cast<std::size_t>(j)], rx, rP);
        }
        table_ = &choose(prior[static_cast<std::size_t>(from)].age);
        reference = s_.C * rx;
        variance = (s_.C * rP * s_.C.transpose()).diagonal() + s_.R;
        expected.assign(static_cast<std::size_t>(s_.m), false);
        tie = false;
        for (int i = 0; i < s_.m; ++i) {
            const double p = (s_.C.row(i) * rP * s_.C.row(i).transpose()).value();
            expected[static_cast<std::size_t>(i)] = p > table_->level(i);
            tie = tie || std::abs(p - table_->level(i)) <= 1e-3 * table_->level(i);
            if (expected[static_cast<std::size_t>(i)]) {
                correct(rx, rP, i, 0.0, s_.R(i));
            }
        }
    }

    void fuse(int k, int now)
    {
        for (int i = 0; i < s_.m; ++i) {
            const Heard &h = heard_[static_cast<std::size_t>(k)][static_cast<std::size_t>(i)];
            const double p = (s_.C.row(i) * P * s_.C.row(i).transpose()).value(), s = p + s_.R(i);
            const double at = (s_.C.row(i) * x).value();
            if (h.value) {
                const double r = h.y - at, f = (s_.huber > 0.0) ? std::abs(r) / (s_.huber * std::sqrt(s)) : 0.0;
                correct(x, P, i, r, (f > 1.0) ? s * f - p : s_.R(i));
            } else if (age[static_cast<std::size_t>(i)] < s_.heartbeat && ((table_->alive >> i) & 1) != 0) {
                const double relax = (now - k < s_.delay) ? table_->early(i) : table_->relax(i);
                if (relax >= 0.0) {
                    correct(x, P, i, reference(i) - at, s_.R(i) + s * relax);
                }
            }
        }
    }

    void pass()
    {
        const int now = static_cast<int>(u_.size()) - 1;
        std::vector<Prior> prior;
        x = s_.x0;
        P = s_.P0;
        age.assign(static_cast<std::size_t>(s_.m), s_.heartbeat);
        for (int k = 0; k <= now; ++k) {
            step(u_[static_cast<std::size_t>(k)], x, P);
            prior.push_back(Prior{x, P, age});
            refer(prior, k);
            if (k < now || closed_) {
                /* While a sample is open, the one before it was closed last. */
                fuse(k, closed_ ? now : now - 1);
                for (int i = 0; i < s_.m; ++i) {
                    int &a = age[static_cast<std::size_t>(i)];
                    a = heard_[static_cast<std::size_t>(k)][static_cast<std::size_t>(i)].value ? 1 : std::min(a + 1, 255);
                }
            }
        }
    }

    const System &s_;
    std::vector<Vector> u_;
    std::vector<std::vector<Heard>> heard_;
    const Table *table_ = nullptr;
    bool closed_ = false;
};

/* ---- the library ---- */

class Library {
public:
    explicit Library(const System &s)
        : slot_(static_cast<std::size_t>(s.depth) + 1U), entry_(slot_.size() * static_cast<std::size_t>(s.m)), sensor_(static_cast<std::size_t>(s.m)),
          record_(static_cast<std::size_t>(s.m)), origin_(static_cast<std::size_t>(s.n)), real_(HG_FUSION_REALS(s.n, s.p, s.m, s.depth)),
          tables_(s.table.size()), range_(static_cast<std::size_t>(s.m), static_cast<hg_real>(1e6))
    {
        c_.states = static_cast<std::uint8_t>(s.n);
        c_.inputs = static_cast<std::uint8_t>(s.p);
        c_.sensors = static_cast<std::uint8_t>(s.m);
        c_.depth = static_cast<std::uint8_t>(s.depth);
        c_.delay = static_cast<std::uint8_t>(s.delay);
        c_.heartbeat = static_cast<std::uint8_t>(s.heartbeat);
        c_.watchdog = static_cast<std::uint8_t>(s.watchdog);
        c_.modulus = 16U;
        c_.trigger = s.trigger;
        c_.A = keep(s.A);
        c_.B = keep(s.B);
        c_.Q = keep(s.Q);
        c_.x0 = keep(s.x0);
        c_.P0 = keep(s.P0);
        c_.R = keep(s.R);
        c_.C = keep(s.C);
        c_.select = s.selected ? s.place.data() : nullptr;
        c_.range = range_.data();
        c_.huber = static_cast<hg_real>(s.huber);
        c_.origin = nullptr;
        c_.rates = 1U;
        c_.rate_step = static_cast<hg_real>(1);
        c_.loss = static_cast<hg_real>(0);
        c_.smoothing = static_cast<hg_real>(0);
        for (std::size_t t = 0; t < tables_.size(); ++t) {
            tables_[t] = hg_fusion_table{s.table[t].alive, keep(s.table[t].level), keep(s.table[t].relax), keep(s.table[t].early)};
        }
        c_.tables = static_cast<std::uint8_t>(tables_.size());
        c_.table = tables_.data();
        const hg_fusion_memory memory = {slot_.data(), entry_.data(), sensor_.data(), record_.data(), origin_.data(), real_.data()};
        started = hg_fusion_start(&self, &c_, &memory);
    }

    hg_fusion self{};
    hg_status started = HG_E_CONFIG;

private:
    const hg_real *keep(const Matrix &m)
    {
        kept_.push_back(row_major(m));
        kept_.back().push_back(static_cast<hg_real>(0)); /* so that there is something to point at */
        return kept_.back().data();
    }

    std::vector<hg_fusion_slot>   slot_;
    std::vector<hg_fusion_entry>  entry_;
    std::vector<hg_fusion_sensor> sensor_;
    std::vector<hg_fusion_record> record_;
    std::vector<std::int32_t>     origin_;
    Reals                         real_;
    std::vector<hg_fusion_table>  tables_;
    Reals                         range_;
    std::vector<Reals>            kept_;
    hg_fusion_config              c_{};
};

std::string apart(const char *what, double found, double expected, double size, int k)
{
    const double tolerance = (narrow ? 3e-4 : 1e-10) * (1.0 + size);
    char text[200];
    std::snprintf(text, sizeof text, "%s in sample %d: %.12g, the oracle has %.12g", what, k, found, expected);
    return (std::abs(found - expected) <= tolerance) ? std::string() : std::string(text);
}

/* What P loses by rounding it loses in parts of the largest it has been: `peak`, which begins with the initial one. */
std::string compare_state(const hg_fusion &f, const Oracle &o, int n, int k, double &peak)
{
    std::string found;
    peak = std::max(peak, o.P.cwiseAbs().maxCoeff());
    for (int a = 0; found.empty() && a < n; ++a) {
        found = apart("x", static_cast<double>(f.x[a]), o.x(a), o.x.cwiseAbs().maxCoeff(), k);
        for (int b = 0; found.empty() && b < n; ++b) {
            found = apart("P", static_cast<double>(f.P[a * n + b]), o.P(a, b), peak, k);
        }
    }
    return found;
}

/* Has sensor i to speak? Empty where the answers agree or the oracle's is within rounding of the threshold. */
std::string compare_due(const System &s, const hg_fusion &f, const Oracle &o, int i, double y, double dice, int k)
{
    const double r = y - o.reference(i), S = o.variance(i), level = o.level(i);
    const double sides[5][2] = {{r * r, level}, {r * r, level * S}, {level * r * r, dice * S}, {S - s.R(i), level}, {0.0, 1.0}};
    const double *side = sides[static_cast<int>(s.trigger) - 1];
    bool speaks = side[0] > side[1];
    bool close = std::abs(side[0] - side[1]) <= 1e-2 * (std::abs(side[0]) + std::abs(side[1]));
    if (s.trigger == HG_FUSION_SCHEDULED) {
        speaks = o.expected[static_cast<std::size_t>(i)];
        close = o.tie;
    }
    speaks = speaks || o.age[static_cast<std::size_t>(i)] >= s.heartbeat;
    const hg_status status = hg_fusion_due(&f, static_cast<std::uint8_t>(i), static_cast<hg_real>(y), static_cast<hg_real>(dice));
    const bool same = (status == HG_OK) == speaks;
    return (same || close) ? std::string() : "trigger of sensor " + std::to_string(i) + " in sample " + std::to_string(k);
}

std::string one_system(Random &random, long &late)
{
    System s = random_system(random);
    if (s.trigger == HG_FUSION_SCHEDULED || s.trigger == HG_FUSION_OWN) {
        for (Table &t : s.table) { /* there silence says nothing: a model's tables say so */
            t.relax.setConstant(-1.0);
            t.early.setConstant(-1.0);
        }
    }
    Library library(s);
    Oracle  oracle(s);
    double  peak = 0.0;
    if (library.started != HG_OK) {
        return "the configuration was refused";
    }
    const bool dead = random.chance(0.3); /* sensor 0, from sample 20 to 45 */
    std::vector<std::vector<double>> sent;
    std::vector<std::vector<int>>    due; /* sample in which each is heard */
    for (int k = 0; k < samples; ++k) {
        const Vector u = s.p > 0 ? Vector(random.matrix(s.p, 1)) : Vector(0);
        const Reals  input = row_major(u);
        static const hg_real none[1] = {0};
        if (hg_fusion_open(&library.self, input.empty() ? none : input.data()) != HG_OK) {
            return "a sample could not be opened";
        }
        oracle.open(u);
        std::string found = compare_state(library.self, oracle, s.n, k, peak);
        sent.emplace_back();
        due.emplace_back();
        for (int i = 0; found.empty() && i < s.m; ++i) {
            const double y = static_cast<double>(static_cast<hg_real>(oracle.reference(i) + random.real(-3.0, 3.0) * std::sqrt(oracle.variance(i))));
            found = compare_due(s, library.self, oracle, i, y, random.real(0.0, 4.0), k);
            const bool speaks = random.chance(0.5) && !(dead && i == 0 && k >= 20 && k < 45);
            sent.back().push_back(y);
            due.back().push_back(speaks ? k + (random.chance(0.4) ? random.whole(0, s.depth) : 0) : -1);
        }
        for (int lag = 0; found.empty() && lag <= std::min(s.depth, k); ++lag) {
            for (int i = 0; i < s.m; ++i) {
                const std::size_t at = static_cast<std::size_t>(k - lag), sensor = static_cast<std::size_t>(i);
                if (due[at][sensor] == k) {
                    late += (lag > 0) ? 1 : 0;
                    oracle.hear(lag, i, sent[at][sensor]);
                    if (hg_fusion_receive(&library.self, static_cast<std::uint8_t>(i), static_cast<std::uint8_t>((k - lag) & 15), 0U, static_cast<hg_real>(sent[at][sensor])) != HG_OK) {
                        return "a frame was refused";
                    }
                }
            }
        }
        if (found.empty() && hg_fusion_close(&library.self) != HG_OK) {
            return "the state was not finite";
        }
        oracle.close();
        found = found.empty() ? compare_state(library.self, oracle, s.n, k, peak) : found;
        if (!found.empty()) {
            return found;
        }
    }
    return std::string();
}

void test_fusion(void **)
{
    const char *text = std::getenv("HULLGUARD_SEED");
    const std::uint64_t seed = (text != nullptr) ? std::strtoull(text, nullptr, 0) : std::random_device()();
    std::printf("HULLGUARD_SEED=%llu\n", static_cast<unsigned long long>(seed));
    Random random(seed * 1000003U + 77U);
    long late = 0;
    std::string failure;
    for (int i = 0; failure.empty() && i < systems; ++i) {
        failure = one_system(random, late);
        failure = failure.empty() ? failure : "system " + std::to_string(i) + ": " + failure;
    }
    if (!failure.empty()) {
        fail_msg("HULLGUARD_SEED=%llu: %s", static_cast<unsigned long long>(seed), failure.c_str());
    }
    std::printf("%d systems, %ld late frames\n", systems, late);
}

} // namespace

int main()
{
    const CMUnitTest tests[] = {cmocka_unit_test(test_fusion)};
    return cmocka_run_group_tests_name("fusion against the oracle", tests, nullptr, nullptr);
}
