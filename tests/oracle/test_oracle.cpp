/** @file
 *  Holds the library against the oracle on random problems, part by part: residuals, thresholds, unknown-input observers, isolation. Built
 *  twice, for float32 and float64. HULLGUARD_SEED repeats a run. */
#include "tables.hpp"

extern "C" {
#include "hullguard/isolate.h"
#include "hullguard/uio.h"
}

namespace {

using namespace problem;

/* ---- a) Residual generators ---- */

struct Worst {
    double of_tolerance = 0.0; /* difference over derived tolerance */
    double relative     = 0.0; /* difference over signal scale */
};

std::string one_residual(Random &random, Worst &worst)
{
    const oracle::Generator g      = random_generator(random);
    const Eigen::Index      m      = g.V.cols(), width = m + g.H.cols(), all = width + random.whole(0, 3), r = g.Mo.rows();
    const auto              places = random_places(random, width, all);
    const double            size   = std::pow(10.0, random.real(-3.0, 3.0));
    const int               samples = 200;

    Residual one(fused(g), places), two(observer(g), places), three(filter(g), identity_places(r));
    if (!one.start() || !two.start() || !three.start()) { return "start refused"; }
    hg_residual_pair pair{two.self, three.self};

    oracle::Cascade     cascade(g);
    std::vector<Vector> expected;
    std::vector<Reals>  of_one, of_pair;
    Vector in_max = Vector::Zero(width), z_max = Vector::Zero(g.G.rows()), both_max = Vector::Zero(2 * g.G.rows());
    Vector both(2 * g.G.rows());
    for (int k = 0; k < samples; ++k) {
        Reals value(static_cast<size_t>(all));
        for (hg_real &v : value) { v = nearest(size * random.real(-1.0, 1.0)); }
        Vector in(width);
        for (Eigen::Index i = 0; i < width; ++i) { in(i) = static_cast<double>(value[places[static_cast<size_t>(i)]]); }
        in_max = in_max.cwiseMax(in.cwiseAbs());
        both << cascade.observer(), cascade.filter();
        both_max = both_max.cwiseMax(both.cwiseAbs());
        z_max    = z_max.cwiseMax((cascade.observer() + cascade.filter()).cwiseAbs()); /* the fused state is their sum */
        expected.push_back(cascade.step(in.head(m), in.tail(width - m)));

        Reals a(static_cast<size_t>(r)), b0(static_cast<size_t>(r)), b(static_cast<size_t>(r));
        if (random.chance(0.02)) { /* a number that is not finite is refused and changes nothing */
            Reals bad = value;
            bad[places[0]] = random.chance(0.5) ? std::numeric_limits<hg_real>::quiet_NaN() : -std::numeric_limits<hg_real>::infinity();
            if (hg_residual_step(&one.self, bad.data(), a.data()) != HG_E_NUMERIC ||
                hg_residual_pair_step(&pair, bad.data(), b0.data(), b.data()) != HG_E_NUMERIC) { return "a bad number was taken"; }
        }
        if (hg_residual_step(&one.self, value.data(), a.data()) != HG_OK) { return "step refused"; }
        if (hg_residual_pair_step(&pair, value.data(), b0.data(), b.data()) != HG_OK) { return "pair refused"; }
        of_one.push_back(a);
        of_pair.push_back(b);
    }
    /* The oracle rounds as well: its own bound, in double, comes on top of the library's. */
    const Vector of_oracle = rounding(series(g), r, both_max, in_max, unit_double);
    const Vector tolerance_one  = rounding(fused(g), r, z_max, in_max, unit) + of_oracle;
    const Vector tolerance_pair = rounding(series(g), r, both_max, in_max, unit) + of_oracle;
    double scale = 0.0;
    for (const Vector &e : expected) { scale = std::max(scale, e.cwiseAbs().maxCoeff()); }
    for (size_t k = 0; k < expected.size(); ++k) {
        for (Eigen::Index i = 0; i < r; ++i) {
            const size_t c    = static_cast<size_t>(i);
            const double d1   = std::abs(static_cast<double>(of_one[k][c]) - expected[k](i));
            const double d2   = std::abs(static_cast<double>(of_pair[k][c]) - static_cast<double>(of_one[k][c]));
            const double most = tolerance_one(i) + tolerance_pair(i);
            worst.of_tolerance = std::max({worst.of_tolerance, d1 / tolerance_one(i), d2 / most});
            worst.relative     = std::max({worst.relative, d1 / scale, d2 / scale});
            if (!(d1 <= tolerance_one(i))) {
                return say("k %zu: r%zu is %.17g, oracle %.17g, off by %g > %g", k, c, static_cast<double>(of_one[k][c]), expected[k](i), d1,
                           tolerance_one(i));
            }
            if (!(d2 <= most)) { return say("k %zu: pair and fused differ by %g > %g", k, d2, most); }
        }
    }
    return {};
}

/* The derived tolerance is rigorous but may be wide for a badly conditioned generator; the flat one, relative to the largest residual, is
 *  what the number type should give: some 10^3 units for orders up to 8 and poles up to 0.95. */
void test_residual(void **)
{
    Random      random = stream(1);
    Worst       worst;
    std::string failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_residual(random, worst);
        if (!failure.empty()) { failure = say("generator %d: ", i) + failure; }
    }
    const double flat = (sizeof(hg_real) == 8) ? 1e-11 : 1e-4;
    std::printf("residual: worst difference %.3g of its tolerance, %.3g of the largest residual\n", worst.of_tolerance, worst.relative);
    if (failure.empty() && !(worst.relative <= flat)) { failure = say("relative difference %g > %g", worst.relative, flat); }
    expect_clean(failure);
}

/* ---- b) The hull ---- */

struct HullCount {
    int modal = 0, power = 0, tight = 0, handed = 0; /* handed: thresholds that still hold what is left of a start */
    double widest = 0.0; /* J over exact J where the tail is negligible */
};

Bias random_bias(Random &random, Eigen::Index settle, Eigen::Index residuals)
{
    const double scale = random.chance(0.7) ? 1.0 : 0.0;
    Bias b{scale * random.matrix(settle, residuals).cwiseAbs(), Matrix(), scale * random.matrix(residuals, 1).cwiseAbs(), Vector(),
           scale * random.matrix(residuals, 1).cwiseAbs()};
    b.moving      = b.rest + scale * random.matrix(settle, residuals).cwiseAbs();
    b.moving_left = b.rest_left + scale * random.matrix(residuals, 1).cwiseAbs();
    return b;
}

/* The header's formula over the radii as they are known now, its impulse responses by simulation (hull) and its theta by its own equation. */
struct Formula {
    oracle::Hull               &hull;
    const Taps                 &taps;
    const Tail                 &tail;
    const Bias                 &start;
    Eigen::Index                outputs;
    Vector                      theta;

    Vector step(const std::vector<Vector> &radius, bool rest)
    {
        const int k = static_cast<int>(radius.size()) - 1, settle = static_cast<int>(start.rest.rows());
        if (k == 0) { theta = Vector::Zero(tail.decay.size()); }
        if (k == settle) { theta += rest ? start.rest_left : start.moving_left; }
        theta = theta.cwiseProduct(tail.decay);
        Vector J = (k < settle) ? Vector((rest ? start.rest : start.moving).row(k).transpose()) : start.later;
        for (Eigen::Index g = 0; g < tail.weight.cols(); ++g) {
            const int lags = taps[static_cast<size_t>(g)];
            if (k >= lags) { theta += tail.weight.col(g) * radius[static_cast<size_t>(k - lags)](g); }
            for (int j = 0; j < lags && j <= k; ++j) {
                const auto lag = static_cast<size_t>(j);
                J += ((g < outputs) ? hull.of_y(lag).col(g) : hull.of_u(lag).col(g - outputs)) * radius[static_cast<size_t>(k - j)](g);
            }
        }
        return J + theta;
    }
};

std::string one_hull(Random &random, HullCount &count)
{
    const oracle::Generator g = random_generator(random);
    const System            s = fused(g);
    const Eigen::Index      m = g.V.cols(), width = s.B.cols(), all = width + random.whole(0, 3), r = s.C.rows();
    const auto              places = random_places(random, width, all);
    const int               most   = random.chance(0.5) ? random.whole(1, 30) : random.whole(30, 120);
    Taps                    taps(static_cast<size_t>(width));
    for (int &t : taps) { t = random.chance(0.1) ? 0 : random.whole(1, most); }
    const int               length = *std::max_element(taps.begin(), taps.end()) + 1 + random.whole(0, 5), settle = random.whole(1, 40);
    const int               ready_rest = random.whole(0, 50), ready_moving = random.whole(0, 50);
    const Bias              start = random_bias(random, settle, r);
    const Tail              tail = tail_of(random, s, taps);
    const HullTables        tables(s, places, taps, start, tail, ready_rest, ready_moving);
    (tail.modal ? count.modal : count.power)++;

    Reals    memory(static_cast<size_t>(all * length)), theta(HG_HULL_REALS(r, 0));
    hg_ring  ring{};
    hg_hull  hull{};
    hg_start how = random.chance(0.5) ? HG_START_REST : HG_START_MOVING;
    if (hg_ring_start(&ring, static_cast<std::uint8_t>(all), static_cast<std::uint8_t>(length), memory.data()) != HG_OK ||
        hg_hull_start(&hull, &tables.config, &ring, how, theta.data()) != HG_OK) { return "start refused"; }

    const oracle::Plant no_plant;
    oracle::Hull        exact(g, no_plant, Vector());
    std::vector<Reals>  radii; /* [sample][place] */
    std::vector<int>    mode(static_cast<size_t>(all), 1);
    Reals               radius(static_cast<size_t>(all));
    const double        peak = (s.D_abs.sum() + s.C_abs.sum() * s.B_abs.sum());
    double              widest = 5.0; /* a rewritten radius is at most 5 */
    Formula             formula{exact, taps, tail, start, m, Vector()};
    for (int step = 0; step < 150; ++step) {
        if (random.chance(0.005)) { /* a restart forgets everything */
            how = random.chance(0.5) ? HG_START_REST : HG_START_MOVING;
            hg_ring_reset(&ring);
            hg_hull_reset(&hull, how);
            radii.clear();
        }
        const int k = static_cast<int>(radii.size());
        random_radii(random, radius, mode);
        if (random.chance(0.02)) {
            Reals bad = radius;
            bad[0] = random.chance(0.5) ? std::numeric_limits<hg_real>::quiet_NaN() : std::numeric_limits<hg_real>::infinity();
            if (hg_ring_push(&ring, bad.data()) != HG_E_NUMERIC) { return "a bad radius was taken"; }
        }
        if (hg_ring_push(&ring, radius.data()) != HG_OK) { return "push refused"; }
        radii.push_back(radius);
        if (random.chance(0.05)) { /* the past turns out to be worse than thought */
            const int first = random.whole(0, static_cast<int>(all) - 1), many = random.whole(1, static_cast<int>(all) - first);
            int       reach = random.whole(1, 20); /* as far as the taps of all that read these places */
            for (size_t i = 0; i < taps.size(); ++i) { reach = (places[i] >= first && places[i] < first + many) ? std::min(reach, taps[i]) : reach; }
            reach = std::min(reach, length - 1);
            for (int lag = 1; lag <= reach; ++lag) {
                Reals wide(static_cast<size_t>(many));
                for (hg_real &w : wide) { w = nearest(random.real(0.0, 5.0)); }
                hg_ring_rewrite(&ring, static_cast<std::uint8_t>(lag), static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(many), wide.data());
                if (lag <= k) { std::copy(wide.begin(), wide.end(), radii[static_cast<size_t>(k - lag)].begin() + first); }
            }
            if (reach > k) { /* before the first sample all radii are 0: put that back */
                const Reals none(static_cast<size_t>(many));
                for (int lag = k + 1; lag <= reach; ++lag) {
                    hg_ring_rewrite(&ring, static_cast<std::uint8_t>(lag), static_cast<std::uint8_t>(first), static_cast<std::uint8_t>(many), none.data());
                }
            }
            const Reals far(static_cast<size_t>(many), nearest(1e6)); /* beyond the ring: ignored */
            hg_ring_rewrite(&ring, static_cast<std::uint8_t>(std::min(255, length + random.whole(0, 9))), static_cast<std::uint8_t>(first),
                             static_cast<std::uint8_t>(many), far.data());
        }
        Reals J(static_cast<size_t>(r));
        hg_hull_step(&hull, &ring, J.data());

        std::vector<Vector> y, u, of_all;
        for (const Reals &row : radii) {
            Vector in(width);
            for (Eigen::Index i = 0; i < width; ++i) { in(i) = static_cast<double>(row[places[static_cast<size_t>(i)]]); }
            y.push_back(in.head(m));
            u.push_back(in.tail(width - m));
            of_all.push_back(in);
        }
        const bool    rest  = how == HG_START_REST;
        const Vector  hull_alone = exact.threshold(y, u), whole = formula.step(of_all, rest);
        const Vector  bias  = (k < settle) ? Vector((rest ? start.rest : start.moving).row(k).transpose()) : start.later;
        const Vector  left  = rest ? start.rest_left : start.moving_left;
        const double  all_taps = std::accumulate(taps.begin(), taps.end(), 0.0);
        const double  slack = 4.0 * unit * (all_taps + 2.0 * static_cast<double>(width) + 12.0 + 3.0 * (k + 1)); /* the decay is widened once a sample */
        for (const hg_real x : radius) { widest = std::max(widest, static_cast<double>(x)); }
        /* rounding of the oracle's and the test's own doubles: powers of a defective matrix, responses that cancel to nothing */
        const double noise = 1e-13 * peak * widest + 1e-12 * whole.maxCoeff();
        for (Eigen::Index i = 0; i < r; ++i) {
            const double j = static_cast<double>(J[static_cast<size_t>(i)]);
            const double handed = (k < settle) ? 0.0 : left(i) * std::pow(tail.decay(i), k - settle + 1), low = hull_alone(i) + bias(i) + handed;
            if (!(j >= low - noise)) { return say("k %d: J%ld %.17g below the exact hull %.17g", k, static_cast<long>(i), j, low); }
            if (!(j >= whole(i) - noise)) { return say("k %d: J%ld %.17g below the formula's %.17g", k, static_cast<long>(i), j, whole(i)); }
            const double high = whole(i) * (1.0 + slack) + noise;
            if (!(j <= high)) { return say("k %d: J%ld %.17g above the formula's %.17g, exact %.17g", k, static_cast<long>(i), j, high, low); }
            count.handed += handed > 1e-3 * low;
            if (low > 1e4 * noise && formula.theta(i) < 1e-6 * low) {
                ++count.tight;
                count.widest = std::max(count.widest, j / low);
            }
        }
        const int ready = (how == HG_START_REST) ? ready_rest : ready_moving;
        if (hg_hull_ready(&hull) != (k + 1 >= ready)) { return say("k %d, ready at %d: hg_hull_ready() says %d", k, ready, hg_hull_ready(&hull)); }
    }
    return {};
}

void test_hull(void **)
{
    Random      random = stream(2);
    HullCount   count;
    std::string failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_hull(random, count);
        if (!failure.empty()) { failure = say("generator %d: ", i) + failure; }
    }
    const double small = (sizeof(hg_real) == 8) ? 1e-5 : 2e-3; /* rounding of up to 720 taps, and the tail allowed above */
    std::printf("hull: %d modal tails, %d power tails, %d thresholds with a negligible tail, widest %.9g x exact, %d with the rest of a start\n",
                count.modal, count.power, count.tight, count.widest, count.handed);
    if (failure.empty() && (count.modal < problems / 10 || count.power < problems / 20 || count.tight < problems || count.handed < problems)) { failure = "too few cases of a kind"; }
    if (failure.empty() && !(count.widest <= 1.0 + small)) { failure = say("%g x exact although the tail is negligible", count.widest); }
    expect_clean(failure);
}

/* ---- Plant, observer, post-filter and threshold together ---- */

/* The signs that drive residual i at sample k to its threshold: the hull is attained, so it is not only an outer bound. */
std::string one_loop(Random &random)
{
    const Loop               l = random_loop(random);
    const oracle::Generator &g = l.generator;
    const Eigen::Index       m = g.V.cols(), p = g.H.cols(), q = l.plant.Ed.cols(), n = l.plant.A.rows();
    const int                last = random.whole(0, 40);
    const Eigen::Index       row  = random.whole(0, static_cast<int>(g.Mo.rows()) - 1);
    const Matrix             F = g.G - g.Lo * g.W, Bd = l.T * l.plant.Ed - (g.L + g.Lo * g.V) * l.plant.Fd;
    const auto sign = [](double x) { return x < 0.0 ? -1.0 : 1.0; };

    std::vector<Matrix> reach{g.Mo * g.W}; /* Mo W F^j */
    for (int j = 0; j <= last; ++j) { reach.push_back(reach.back() * F); }
    const auto response = [&](int lag, const Matrix &direct, const Matrix &input) -> Matrix {
        return lag == 0 ? direct : Matrix(reach[static_cast<size_t>(lag - 1)] * input);
    };

    oracle::Hull        hull(g, l.plant, l.initial);
    oracle::Cascade     cascade(g);
    const Matrix        bias = bias_by_error(l, last + 1);
    std::vector<Vector> y_radius, u_radius;
    Vector x(n), r, J, u_true;
    for (Eigen::Index i = 0; i < n; ++i) { x(i) = l.initial(i) * sign((reach[static_cast<size_t>(last)] * l.T)(row, i)); }
    for (int k = 0; k <= last; ++k) {
        const Matrix of_y = response(last - k, g.Mo * g.V, -(g.L + g.Lo * g.V)), of_u = response(last - k, -g.Mo * g.Qu, -(g.H - g.Lo * g.Qu));
        const Matrix of_d = response(last - k, g.Mo * g.V * l.plant.Fd, Bd);
        y_radius.push_back(random.matrix(m, 1).cwiseAbs());
        u_radius.push_back(random.matrix(p, 1).cwiseAbs());
        Vector ey = y_radius.back(), eu = u_radius.back(), d = Vector::Ones(q);
        for (Eigen::Index i = 0; i < m; ++i) { ey(i) *= sign(of_y(row, i)); }
        for (Eigen::Index i = 0; i < p; ++i) { eu(i) *= sign(of_u(row, i)); }
        for (Eigen::Index i = 0; i < q; ++i) { d(i) *= sign(of_d(row, i)); }
        u_true = random.matrix(p, 1);
        r = cascade.step(l.plant.C * x + l.plant.D * u_true + l.plant.Fd * d + ey, u_true + eu);
        J = hull.threshold(y_radius, u_radius);
        x = l.plant.A * x + l.plant.B * u_true + l.plant.Ed * d;
        if (!((r.cwiseAbs() - J).maxCoeff() <= 1e-9 * J.maxCoeff())) { return say("k %d: a fault-free residual above its threshold", k); }
        const std::vector<Vector> none_y(static_cast<size_t>(k + 1), Vector::Zero(m)), none_u(static_cast<size_t>(k + 1), Vector::Zero(p));
        const double              off = (hull.threshold(none_y, none_u).transpose() - bias.row(k)).cwiseAbs().maxCoeff();
        if (!(off <= 1e-9 * (1.0 + bias.row(k).maxCoeff()))) { return say("k %d: bias by simulation and by error differ by %g", k, off); }
    }
    if (!(std::abs(std::abs(r(row)) - J(row)) <= 1e-9 * J(row))) { return say("worst case %.12g, threshold %.12g", r(row), J(row)); }
    return {};
}

void test_oracle_itself(void **)
{
    Random      random = stream(3);
    std::string failure;
    for (int i = 0; i < problems / 2 && failure.empty(); ++i) {
        failure = one_loop(random);
        if (!failure.empty()) { failure = say("loop %d: ", i) + failure; }
    }
    expect_clean(failure);
}

/* ---- The unknown-input observer (suspension, sections 1.1 and 1.4) ---- */

struct UnknownInput {
    oracle::UnknownInputPlant plant;
    Matrix                    K1;
    double                    sample_time = 0.0;
    Vector                    low;
};

/* In coordinates x = [hidden; y] with G = [0; G2], A1 = (I - HC) A leaves the hidden rows of A as they are: they are the invariant zeros, stable because A
 *  is diagonally dominant, and K1 cancels their coupling and puts the other poles where it likes. Then seen from a random basis. */
UnknownInput random_unknown_input(Random &random)
{
    const int    n = random.whole(2, 8), q = random.whole(1, std::min(3, n)), m = random.whole(q, n), p = random.whole(1, 2), h = n - m;
    UnknownInput u;
    const Matrix A = random.matrix(n, n) - (n + 0.5) * Matrix::Identity(n, n);
    Matrix       G = Matrix::Zero(n, q), C = Matrix::Zero(m, n), K1(n, m), T = random.matrix(n, n) + 3.0 * Matrix::Identity(n, n);
    Matrix       G2 = random.matrix(m, q);
    G2.topRows(q) += 2.0 * Matrix::Identity(q, q);
    G.bottomRows(m) = G2;
    C.rightCols(m) = Matrix::Identity(m, m);
    const Matrix P = Matrix::Identity(m, m) - G2 * (G2.transpose() * G2).inverse() * G2.transpose();
    Vector       poles(m);
    for (Eigen::Index i = 0; i < m; ++i) { poles(i) = random.real(0.5, 8.0); }
    K1.topRows(h) = A.topRightCorner(h, m);
    K1.bottomRows(m) = P * A.bottomRightCorner(m, m) + Matrix(poles.asDiagonal());
    while (std::abs(T.determinant()) < 0.1) { T += Matrix::Identity(n, n); }
    u.plant = {T * A * T.inverse(), T * random.matrix(n, p), T * G, C * T.inverse()};
    u.K1 = T * K1;
    u.sample_time = random.real(0.01, 0.1);
    u.low = Vector(q);
    for (Eigen::Index i = 0; i < q; ++i) { u.low(i) = random.chance(0.2) ? 1.0 : random.real(0.05, 0.9); }
    return u;
}

/* uio.h: s, g -> fhat, xhat */
System estimator(const oracle::UnknownInputObserver &o, const Vector &low)
{
    const Eigen::Index n = o.Fd.rows(), q = low.size(), m = o.H.cols(), p = o.Bd.cols();
    const Matrix a = low.asDiagonal(), keep = Matrix::Identity(q, q) - a, direct = o.K1d + o.H;
    const Matrix N = keep * a * o.inverse - a * o.inverse * o.Ad;
    Matrix       A(n + q, n + q), B(n + q, m + p), C(q + n, n + q), D(q + n, m + p);
    A << o.Fd, Matrix::Zero(n, q), N, keep;
    B << o.Fd * o.K1d + o.K0, o.Bz, N * direct, -a * o.inverse * o.Bd;
    C << a * o.inverse, Matrix::Identity(q, q), Matrix::Identity(n, n), Matrix::Zero(n, q);
    D << a * o.inverse * direct, Matrix::Zero(q, p), direct, Matrix::Zero(n, p);
    return plain(A, B, C, D);
}

/* A theta for each eigenvalue; hull.h */
struct Modes {
    Vector decay;
    Matrix input, output; /* modes x width, estimates x modes */
    Reals  decay_table, input_table, output_table, none;

    Modes(const System &s, int taps)
    {
        const Spectrum spectrum = spectrum_of(s);
        const double   widen = 1.0 + unit * (10.0 + static_cast<double>(s.B.cols() + s.A.rows()));
        decay  = spectrum.decay;
        input  = spectrum.input;
        output = spectrum.output * Vector(decay.array().pow(taps - 1)).asDiagonal();
        HullTables::append(decay_table, decay.transpose() * (1.0 + 8.0 * unit));
        HullTables::append(input_table, input * widen);
        HullTables::append(output_table, output * widen);
        none.assign(static_cast<size_t>(decay.size()), static_cast<hg_real>(0));
    }
    void into(hg_hull_config &config) const
    {
        config.modes = static_cast<std::uint8_t>(decay.size());
        config.mode_decay = decay_table.data();
        config.mode_input = input_table.data();
        config.mode_output = output_table.data();
        config.mode_rest = config.mode_moving = none.data();
    }
};

struct UioCount {
    int    observers = 0;
    double wrong = 0.0; /* largest difference over its tolerance */
    double wide  = 0.0; /* sum of the logarithms of radius over exact, */
    double common = 0.0; /* the same with one decay for all modes, */
    int    radii = 0;   /* and how many */
};

/* One observer in the library beside the oracle's. */
struct Estimating {
    System           system;
    Residual         residual;
    Tail             no_tail;
    HullTables       hull;
    Modes            modes;
    hg_uio_config    config{};
    hg_uio           self{};
    hg_ring          ring{};
    Reals            ring_memory, memory;

    Estimating(const System &s, const std::vector<std::uint8_t> &places, Eigen::Index all, Eigen::Index q, int taps)
        : system(s), residual(s, places), no_tail{Vector::Zero(s.C.rows()), Matrix::Zero(s.C.rows(), s.B.cols()), true},
          hull(s, places, Taps(places.size(), taps), no_bias(s.C.rows()), no_tail, 0, 0), modes(s, taps)
    {
        config.actuators = static_cast<std::uint8_t>(q);
        config.states = static_cast<std::uint8_t>(s.C.rows() - q);
        config.observer = residual.config;
        config.hull = hull.config;
        modes.into(config.hull);
        ring_memory.resize(static_cast<size_t>(all * (taps + 1)));
        memory.resize(HG_UIO_REALS(s.A.rows(), s.B.cols(), s.C.rows(), config.hull.modes));
    }
    static Bias no_bias(Eigen::Index residuals)
    {
        return {Matrix::Zero(1, residuals), Matrix::Zero(1, residuals), Vector::Zero(residuals), Vector::Zero(residuals), Vector::Zero(residuals)};
    }
    bool start(Eigen::Index all, int taps)
    {
        return hg_ring_start(&ring, static_cast<std::uint8_t>(all), static_cast<std::uint8_t>(taps + 1), ring_memory.data()) == HG_OK &&
               hg_uio_start(&self, &config, &ring, HG_START_REST, memory.data()) == HG_OK;
    }
};

/* The exact radius by the impulse response, what the tail by modes may add, and what a common one would. */
struct Sums {
    Vector exact, modal, common;
};

Sums sums_of(const System &s, const Modes &modes, int taps, const std::vector<Vector> &radii)
{
    Sums         sum{s.D_abs * radii.back(), Vector::Zero(s.C.rows()), Vector::Zero(s.C.rows())};
    Matrix       response = s.B;
    const double slowest = modes.decay.maxCoeff();
    const Vector at_once = modes.output.rowwise().sum(), most = modes.input.colwise().maxCoeff().transpose();
    sum.modal = sum.common = sum.exact;
    for (size_t lag = 1; lag < radii.size(); ++lag) {
        const Vector &radius = radii[radii.size() - 1 - lag];
        const Vector  part = (s.C * response).cwiseAbs() * radius;
        const auto    behind = static_cast<double>(lag) - taps;
        sum.exact += part;
        if (behind < 0) {
            sum.modal += part;
            sum.common += part;
        } else {
            sum.modal += modes.output * Vector(modes.decay.array().pow(behind)).asDiagonal() * modes.input * radius;
            sum.common += at_once * std::pow(slowest, behind) * most.dot(radius);
        }
        response = s.A * response;
    }
    return sum;
}

std::string compare_estimates(const Estimating &lib, const oracle::UnknownInputObserver &exact, const Vector &tolerance, const Reals &estimate,
                              UioCount &count)
{
    const Eigen::Index q = exact.input().size();
    for (Eigen::Index i = 0; i < lib.system.C.rows(); ++i) {
        const double mine = (i < q) ? exact.input()(i) : exact.state()(i - q), its = static_cast<double>(estimate[static_cast<size_t>(i)]);
        count.wrong = std::max(count.wrong, std::abs(its - mine) / tolerance(i));
        if (!(std::abs(its - mine) <= tolerance(i))) { return say("estimate %ld: %.17g, oracle %.17g, tolerance %g", static_cast<long>(i), its, mine, tolerance(i)); }
    }
    return {};
}

std::string compare_radii(const Sums &sum, double slack, double noise, const Reals &bound, UioCount &count)
{
    for (Eigen::Index i = 0; i < sum.exact.size(); ++i) {
        const double its = static_cast<double>(bound[static_cast<size_t>(i)]);
        if (!(its >= sum.exact(i) * (1.0 - 1e-12) - noise)) { return say("radius %ld: %.17g below the exact %.17g", static_cast<long>(i), its, sum.exact(i)); }
        if (!(its <= sum.modal(i) * (1.0 + slack) + noise)) { return say("radius %ld: %.17g above %.17g", static_cast<long>(i), its, sum.modal(i)); }
        if (sum.exact(i) > 1e3 * noise) {
            count.wide += std::log(its / sum.exact(i));
            count.common += std::log(sum.common(i) / sum.exact(i));
            count.radii++;
        }
    }
    return {};
}

/* Constant unknown inputs move the plant from rest; in the end all estimates are the truth, because y is straight by then. */
std::string truth_is_found(const UnknownInput &u, Estimating &lib, const std::vector<std::uint8_t> &places, const Vector &tolerance, Random &random)
{
    const oracle::UnknownInputObserver o(u.plant, u.K1, u.sample_time, u.low);
    const Eigen::Index q = u.low.size(), n = o.Ad.rows();
    const Vector       f = random.matrix(q, 1), in = random.matrix(o.Bd.cols(), 1);
    Vector             x = Vector::Zero(n);
    Reals              value(lib.ring.width), estimate(static_cast<size_t>(n + q)), bound(estimate.size()), none(lib.ring.width);
    hg_uio_reset(&lib.self, HG_START_REST);
    hg_ring_reset(&lib.ring);
    for (int k = 0; k < 6000; ++k) {
        Vector signals(places.size());
        signals << u.plant.C * x, in;
        for (size_t i = 0; i < places.size(); ++i) { value[places[i]] = nearest(signals(static_cast<Eigen::Index>(i))); }
        if (hg_ring_push(&lib.ring, none.data()) != HG_OK || hg_uio_step(&lib.self, value.data(), &lib.ring, estimate.data(), bound.data()) != HG_OK) { return "refused"; }
        x = o.Ad * x + o.Bd * in + o.Gd * f;
    }
    for (Eigen::Index i = 0; i < n + q; ++i) {
        const double truth = (i < q) ? f(i) : x(i - q), its = static_cast<double>(estimate[static_cast<size_t>(i)]);
        if (!(std::abs(its - truth) <= tolerance(i) + 1e-8)) { return say("estimate %ld: %.17g, truth %.17g, tolerance %g", static_cast<long>(i), its, truth, tolerance(i)); }
    }
    return {};
}

std::string one_uio(Random &random, UioCount &count)
{
    const UnknownInput           u = random_unknown_input(random);
    oracle::UnknownInputObserver exact(u.plant, u.K1, u.sample_time, u.low);
    const System                 s = estimator(exact, u.low);
    const Eigen::Index           width = s.B.cols(), m = exact.H.cols(), all = width + random.whole(0, 2), q = u.low.size();
    if (!diagonalisable(s.A)) { return {}; }
    const auto  places = random_places(random, width, all);
    const int   taps = random.whole(1, 40), samples = 150;
    Estimating  lib(s, places, all, q, taps);
    if (!lib.start(all, taps)) { return "start refused"; }
    ++count.observers;

    std::vector<Vector> radii;
    std::vector<int>    mode(static_cast<size_t>(all), 1);
    Reals               radius(static_cast<size_t>(all)), value(static_cast<size_t>(all)), estimate(static_cast<size_t>(s.C.rows())), bound(estimate.size());
    const Vector        ones = Vector::Ones(width);
    Matrix              reach = s.B_abs, response = s.B; /* of the state, for signals of at most 1 */
    for (int j = 0; j < 3000; ++j) {
        response = s.A * response;
        reach += response.cwiseAbs();
    }
    const Vector tolerance = 4.0 * rounding(s, m, reach * ones, ones, unit) + Vector::Constant(s.C.rows(), 1e-11);
    for (int k = 0; k < samples; ++k) {
        random_radii(random, radius, mode);
        Vector in(width), wide(width);
        for (hg_real &v : value) { v = nearest(random.real(-1.0, 1.0)); }
        for (Eigen::Index i = 0; i < width; ++i) {
            in(i) = static_cast<double>(value[places[static_cast<size_t>(i)]]);
            wide(i) = static_cast<double>(radius[places[static_cast<size_t>(i)]]);
        }
        exact.step(in.head(m), in.tail(width - m));
        radii.push_back(wide);
        if (hg_ring_push(&lib.ring, radius.data()) != HG_OK || hg_uio_step(&lib.self, value.data(), &lib.ring, estimate.data(), bound.data()) != HG_OK) { return "refused"; }
        std::string wrong = compare_estimates(lib, exact, tolerance, estimate, count);
        const Sums  sum = sums_of(s, lib.modes, taps, radii);
        if (wrong.empty()) { wrong = compare_radii(sum, 8.0 * unit * (taps * static_cast<double>(width) + 20.0 + 4.0 * (k + 1)), 1e-11 * sum.modal.maxCoeff(), bound, count); }
        if (!wrong.empty()) { return say("k %d: ", k) + wrong; }
    }
    return truth_is_found(u, lib, places, tolerance, random);
}

void test_uio(void **)
{
    Random      random = stream(9);
    UioCount    count;
    std::string failure;
    for (int i = 0; i < problems / 10 && failure.empty(); ++i) {
        failure = one_uio(random, count);
        if (!failure.empty()) { failure = say("observer %d: ", i) + failure; }
    }
    const double wide = std::exp(count.wide / std::max(count.radii, 1)), common = std::exp(count.common / std::max(count.radii, 1));
    std::printf("uio: %d observers, worst difference %.3g of its tolerance, radii %.3g x exact (%.3g with one decay; geometric means)\n", count.observers, count.wrong, wide, common);
    if (failure.empty() && count.observers < problems / 20) { failure = "too few observers"; }
    expect_clean(failure);
}

/* ---- Isolation (suspension, section 1.6; isolate.h) ---- */

struct Cause {
    hg_cause      cause = HG_CAUSE_UNDECIDED;
    std::uint32_t candidates = 0;
    double        nearest = 1.0; /* of all comparisons to being another one, relative */
};

/* Is a > b? */
bool above(Cause &c, double a, double b)
{
    c.nearest = std::min(c.nearest, std::abs(a - b) / std::max({std::abs(a), std::abs(b), 1e-300}));
    return a > b;
}

/* The table in isolate.h, from all numbers of the window. */
Cause cause_of(const Matrix &X, const Vector &y, const Vector &excitation, double limit, double steady, double explained)
{
    Cause             c;
    const Vector      yc = y.array() - y.mean();
    const auto        scatter = [&](const Vector &v) { return std::sqrt((v.array() - v.mean()).square().mean()); };
    const auto        share = [](const Vector &a, const Vector &b) { return std::pow(a.dot(b), 2.0) / (a.squaredNorm() * b.squaredNorm()); };
    std::uint32_t     named = 0, rivals = 0, all = 0;
    for (Eigen::Index i = 0; i < X.cols(); ++i) {
        const Vector        x = X.col(i), xc = x.array() - x.mean();
        const std::uint32_t bit = 2U << i;
        const bool          moves = above(c, scatter(x), excitation(i)), means = above(c, share(xc, yc), limit), zero = above(c, share(x, y), limit);
        const bool          still = above(c, std::abs(x.mean()), steady * scatter(x)), large = above(c, std::abs(x.mean()), 0.5 * std::abs(y.mean()));
        named |= (moves && means && zero) ? bit : 0U;
        rivals |= (still && large) ? bit : 0U;
        all |= bit;
    }
    if (named != 0U) {
        c.candidates = named;
        c.cause = ((named & (named - 1U)) == 0U) ? HG_CAUSE_COMPONENT : HG_CAUSE_AMBIGUOUS;
    } else if (above(c, std::abs(y.mean()), steady * scatter(y))) {
        c.candidates = rivals | 1U;
        c.cause = (rivals == 0U) ? HG_CAUSE_ACTUATOR : HG_CAUSE_AMBIGUOUS;
    } else {
        c.candidates = above(c, explained, limit) ? all : (all | 1U);
        c.cause = HG_CAUSE_AMBIGUOUS;
    }
    return c;
}

struct IsolateCount {
    double worst = 0.0; /* difference of fhat as explained, over its scatter */
    int    windows = 0, solved = 0, close = 0;
    int    causes[6] = {};
};

/* Of one window: the same explanation of fhat, the same R^2, the same cause. */
std::string compare_window(const hg_isolate &lib, const hg_isolation &found, const hg_isolate_config &config, const Matrix &X, const Vector &y,
                           IsolateCount &count)
{
    const Eigen::Index rows = X.rows(), c = X.cols();
    Matrix             design(rows, c + 1);
    design << Vector::Ones(rows), X;
    const Vector b = design.colPivHouseholderQr().solve(y);
    Vector       mine(c + 1), excitation(c);
    for (Eigen::Index i = 0; i <= c; ++i) { mine(i) = static_cast<double>(lib.share[i]); }
    for (Eigen::Index i = 0; i < c; ++i) { excitation(i) = static_cast<double>(config.excitation[i]); }
    const double size = std::sqrt(y.squaredNorm() / static_cast<double>(rows)), total = (y.array() - y.mean()).square().sum();
    const double explained = 1.0 - (y - design * b).squaredNorm() / total;
    const double off = (design * (mine - b)).cwiseAbs().maxCoeff() / size, allowed = 2e3 * unit;
    /* A column that moves too little beyond what the ones before it explain has no share there. */
    const Vector moves = Matrix(Eigen::HouseholderQR<Matrix>(design).matrixQR()).diagonal().tail(c).cwiseAbs() / std::sqrt(static_cast<double>(rows));
    const bool   solved = (moves.array() > 1.01 * excitation.array()).all();
    if (solved) {
        count.worst = std::max(count.worst, off / allowed);
        ++count.solved;
    }
    if (solved && !(off <= allowed)) { return say("fhat is explained %g off, of its size", off); }
    if (!(std::abs(static_cast<double>(found.explained) - explained) <= 1e4 * unit)) {
        return say("R^2 %.9g, oracle %.9g", static_cast<double>(found.explained), explained);
    }
    const Cause cause = cause_of(X, y, excitation, static_cast<double>(config.explained), static_cast<double>(config.steady), explained);
    ++count.windows;
    if (cause.nearest < 1e-3) {
        ++count.close;
        return {};
    }
    ++count.causes[cause.cause];
    return (cause.cause == found.cause && cause.candidates == found.candidates)
               ? std::string()
               : say("cause %d of %x, oracle %d of %x", found.cause, found.candidates, cause.cause, cause.candidates);
}

std::string one_isolation(Random &random, IsolateCount &count)
{
    const int  c = random.whole(0, 5), e = c + 1, block = random.whole(2 + 2 * c, 40), blocks = random.whole(1, 5), settle = random.whole(0, 30);
    Reals      whole, excitation(static_cast<size_t>(c)), memory(HG_ISOLATE_REALS(c, blocks));
    Vector     share = Vector::Zero(c), middle = Vector::Zero(c);
    const double low = random.chance(0.3) ? 1.0 : random.real(0.05, 0.9), motion = random.chance(0.3) ? 0.01 : 1.0;
    const double offset = random.chance(0.5) ? random.real(-5.0, 5.0) : 0.0, noise = std::pow(10.0, random.real(-3.0, 0.0));
    for (int i = 0; i < c; ++i) {
        for (int j = 0; j < e; ++j) { whole.push_back(nearest(j == i + 1 ? 1.0 : random.real(-0.2, 0.2))); }
        whole[static_cast<size_t>(i * e)] = nearest(0.0);
        excitation[static_cast<size_t>(i)] = nearest(std::pow(10.0, random.real(-3.0, -1.0)));
        middle(i) = random.chance(0.5) ? random.real(-3.0, 3.0) : 0.0;
    }
    const int weak = random.whole(0, c + 1); /* which component, if any */
    if (weak < c) { share(weak) = random.real(0.1, 1.0); }
    if (c > 1 && random.chance(0.2)) { share(c - 1) = random.real(0.1, 1.0); }
    hg_isolate_config config{};
    config.estimates = static_cast<std::uint8_t>(e);
    config.components = static_cast<std::uint8_t>(c);
    config.whole = whole.data();
    config.excitation = excitation.data();
    config.low_pass = nearest(low);
    config.settle = static_cast<std::uint32_t>(settle);
    config.release = 1000000U;
    config.block = static_cast<std::uint16_t>(block);
    config.blocks = static_cast<std::uint8_t>(blocks);
    config.explained = nearest(0.9);
    config.steady = nearest(5.0);
    hg_isolate   lib{};
    hg_isolation found{};
    if (hg_isolate_start(&lib, &config, memory.data()) != HG_OK) { return "start refused"; }
    Matrix X(0, c);
    Vector y, smooth = Vector::Zero(c), last = Vector::Zero(c), turn = Vector::Zero(c);
    for (int k = 0; k < settle + block * (blocks + 3); ++k) {
        Reals  estimate(static_cast<size_t>(e)), radius(static_cast<size_t>(e), nearest(0.0));
        Vector force = Vector::Zero(c), truth = Vector::Zero(e);
        for (int i = 0; i < c; ++i) {
            turn(i) = 0.9 * turn(i) + random.real(-1.0, 1.0);
            estimate[static_cast<size_t>(i + 1)] = nearest(middle(i) + motion * turn(i));
            truth(i + 1) = static_cast<double>(estimate[static_cast<size_t>(i + 1)]);
        }
        for (int i = 0; i < c; ++i) {
            for (int j = 0; j < e; ++j) { force(i) += static_cast<double>(whole[static_cast<size_t>(i * e + j)]) * truth(j); }
        }
        smooth += static_cast<double>(config.low_pass) * (0.5 * (force + last) - smooth);
        last = force;
        const double fault = offset + share.dot(smooth) + noise * random.real(-1.0, 1.0);
        estimate[0] = nearest(k == 0 ? 1.0 : fault);
        if (hg_isolate_step(&lib, estimate.data(), radius.data(), &found) != HG_OK) { return "refused"; }
        if (k >= settle) {
            X.conservativeResize(X.rows() + 1, c);
            y.conservativeResize(y.size() + 1);
            X.row(X.rows() - 1) = smooth.transpose();
            y(y.size() - 1) = static_cast<double>(estimate[0]);
        }
        const int seen = k + 1 - settle;
        if (seen >= block * blocks && seen % block == 0) {
            const std::string wrong = compare_window(lib, found, config, X.bottomRows(block * blocks), y.tail(block * blocks), count);
            if (!wrong.empty()) { return say("k %d: ", k) + wrong; }
        }
    }
    return {};
}

void test_isolate(void **)
{
    Random       random = stream(10);
    IsolateCount count;
    std::string  failure;
    for (int i = 0; i < problems && failure.empty(); ++i) {
        failure = one_isolation(random, count);
        if (!failure.empty()) { failure = say("isolation %d: ", i) + failure; }
    }
    std::printf("isolate: %d windows (%d solved, %d too close to a limit to compare): %d actuator, %d component, %d ambiguous; worst explanation %.3g of its tolerance\n",
                count.windows, count.solved, count.close, count.causes[HG_CAUSE_ACTUATOR], count.causes[HG_CAUSE_COMPONENT], count.causes[HG_CAUSE_AMBIGUOUS], count.worst);
    if (failure.empty() && std::min({count.causes[HG_CAUSE_ACTUATOR], count.causes[HG_CAUSE_COMPONENT], count.causes[HG_CAUSE_AMBIGUOUS]}) < problems / 10) {
        failure = "too few causes of a kind";
    }
    expect_clean(failure);
}
} // namespace

int main()
{
    begin_run();
    const CMUnitTest tests[] = {
        cmocka_unit_test(test_residual), cmocka_unit_test(test_hull), cmocka_unit_test(test_oracle_itself), cmocka_unit_test(test_uio),
        cmocka_unit_test(test_isolate),
    };
    return cmocka_run_group_tests_name("oracle", tests, nullptr, nullptr);
}
