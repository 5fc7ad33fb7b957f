#include "polynomial_oracle.hpp"

namespace oracle {

namespace {

double split_weight(double mean) { return std::clamp(std::sqrt(std::max(mean, 0.0)), 1e-4, 10.0); }

/* Share by which a weight can be off whose square is a mean of shares. */
double part(double size, double value) { return (value > 0.0) ? size / value : 0.0; }

/* All of some variables. */
Sized linear_part(const std::vector<Series> &rows, int first, int count)
{
    Sized found{Matrix(rows.size(), count), Matrix(rows.size(), count)};
    for (size_t i = 0; i < rows.size(); ++i) {
        found.value.row(static_cast<Eigen::Index>(i)) = rows[i].value[1].segment(first, count).transpose();
        found.size.row(static_cast<Eigen::Index>(i)) = rows[i].size[1].segment(first, count).transpose();
    }
    return found;
}

Sized diagonal(const Vector &v) { return exact(Matrix(v.asDiagonal())); }

Sized chosen(const Sized &m, const std::vector<int> &rows, const std::vector<int> &columns)
{
    return {m.value(rows, columns), m.size(rows, columns)};
}

std::vector<int> counted(int first, int count)
{
    std::vector<int> list;
    for (int i = 0; i < count; ++i) {
        list.push_back(first + i);
    }
    return list;
}

/* times a number that can be off by so much */
Sized widened(const Sized &m, double factor, double size) { return {factor * m.value, factor * m.size + size * m.value.cwiseAbs()}; }

Sized nothing(Eigen::Index rows, Eigen::Index columns) { return exact(Matrix::Zero(rows, columns)); }

} // namespace

PolynomialFilter::PolynomialFilter(const PolynomialPlant &plant, int degree, bool bounded, const PolynomialLevels &levels)
    : n_(plant.states()), p_(plant.outputs()), mu_(degree), all_(2 * n_ + p_), top_(bounded ? degree + 1 : degree), plant_(plant), levels_(levels), bounded_(bounded)
{
    X = tuples(n_, mu_);
    Y = tuples(p_, mu_);
    Y.erase(Y.begin());
    noises_ = tuples(n_ + p_, mu_);
    ring_ = tuples(all_, top_);
    state_place_ = places(X);
    const std::map<Tuple, int> ring_place = places(ring_), noise_place = places(noises_);
    Eigen::Index entries = 1;
    for (int k = 0; k <= top_; ++k, entries *= all_) {
        collected_.emplace_back();
        for (Eigen::Index at = 0; at < entries; ++at) {
            Tuple t;
            for (Eigen::Index left = at, i = 0; i < k; ++i, left /= all_) {
                t.push_back(static_cast<int>(left % all_));
            }
            std::sort(t.begin(), t.end());
            collected_.back().push_back(ring_place.at(t));
        }
    }
    for (const Tuple &t : ring_) {
        parts_.emplace_back();
        for (int i : t) {
            (i < n_ ? parts_.back().first : parts_.back().second).push_back(i < n_ ? i : i - n_);
        }
    }
    for (size_t m = 0; m < ring_.size(); ++m) {
        const bool kept = ring_[m].size() <= static_cast<size_t>(mu_);
        root_.push_back(root_of_square(parts_[m].second));
        noise_at_.push_back(kept ? static_cast<size_t>(noise_place.at(parts_[m].second)) : 0);
        state_at_.push_back(kept ? state_place_.at(parts_[m].first) : 0);
    }
    for (size_t a = 0; a < noises_.size(); ++a) {
        noise_mean_.push_back(mean_of(noises_[a], {}));
        for (size_t b = 0; b < noises_.size(); ++b) {
            const double covariance = covariance_of(noises_[a], noises_[b]);
            if (covariance != 0.0) {
                correlated_.push_back({a, b, covariance});
            }
        }
    }
    const Matrix m = moments();
    const Eigen::Index N = m.rows() - 1;
    M = exact(m);
    z = exact(m.col(0));
    P = exact(m.bottomRightCorner(N, N) - m.col(0).tail(N) * m.col(0).tail(N).transpose());
    c = exact(plant.x0);
    Pe = diagonal(plant.P0);
    mean = Vector::Zero(p_);
}

Matrix PolynomialFilter::moments() const
{
    Matrix m(X.size(), X.size());
    for (size_t a = 0; a < X.size(); ++a) {
        for (size_t b = 0; b < X.size(); ++b) { /* E prod (x0_i + normal_i)^k */
            double product = 1.0;
            for (int i = 0; i < n_; ++i) {
                const auto k = std::count(X[a].begin(), X[a].end(), i) + std::count(X[b].begin(), X[b].end(), i);
                product *= Noise{plant_.P0(i), false}.moment(static_cast<int>(k));
            }
            m(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) = product;
        }
    }
    return m;
}

double PolynomialFilter::mean_of(const Tuple &a, const Tuple &b) const
{
    double product = 1.0;
    for (int i = 0; i < n_ + p_; ++i) {
        const auto k = std::count(a.begin(), a.end(), i) + std::count(b.begin(), b.end(), i);
        product *= plant_.noise[static_cast<size_t>(i)].moment(static_cast<int>(k));
    }
    return product;
}

Series PolynomialFilter::put_in(const std::vector<Term> &row, const std::vector<Series> &states) const
{
    Series sum(all_, top_);
    for (const Term &t : row) {
        Series product(all_, top_);
        product.add(0, 0, t.coefficient, std::abs(t.coefficient));
        for (int i : t.factor) {
            product = product * states[static_cast<size_t>(i)];
        }
        sum.add(product, 1.0, 0.0);
    }
    return sum;
}

Matrix PolynomialFilter::slope_at(const Vector &at) const
{
    Matrix slope = Matrix::Zero(n_, n_);
    for (int l = 0; l < n_; ++l) {
        for (const Term &t : plant_.f[static_cast<size_t>(l)]) {
            for (size_t i = 0; i < t.factor.size(); ++i) {
                Term rest = t;
                rest.factor.erase(rest.factor.begin() + static_cast<std::ptrdiff_t>(i));
                slope(l, t.factor[i]) += evaluate({rest}, at);
            }
        }
    }
    return slope;
}

/* H, F, and the auxiliary filter's own course: its covariance in the short form F1 (Pe - L S L') F1' + Q. */
void PolynomialFilter::auxiliary(const Vector &y, const Vector &radius, std::vector<Series> &H, std::vector<Series> &F)
{
    std::vector<Series> shift;
    for (int l = 0; l < n_; ++l) {
        shift.emplace_back(all_, top_);
        shift.back().add(0, 0, c.value(l), std::abs(c.value(l)));
        shift.back().add(1, l, 1.0, 1.0);
    }
    eta_ = {Matrix::Zero(p_, 1), Matrix::Zero(p_, 1)};
    std::vector<int> fresh;
    for (int j = 0; j < p_; ++j) {
        H.push_back(put_in(plant_.h[static_cast<size_t>(j)], shift));
        const double size = H.back().size[0](0), at = H.back().drop_constant();
        if (std::isfinite(radius(j))) {
            eta_.value(j) = y(j) - at;
            eta_.size(j) = size + std::abs(y(j));
        }
        if (radius(j) <= levels_.fresh(j)) {
            fresh.push_back(j);
        }
        H.back().add(1, 2 * n_ + j, 1.0, 1.0);
    }
    const Sized H1 = linear_part(H, 0, n_), exact_Pe = exact(Pe.value);
    Vector Q(n_), R(p_);
    for (int i = 0; i < n_ + p_; ++i) {
        (i < n_ ? Q(i) : R(i - n_)) = plant_.noise[static_cast<size_t>(i)].variance;
    }
    const Sized PH = exact_Pe * transposed(H1), S = H1 * PH + diagonal(R);
    Sized L{Matrix::Zero(n_, p_), Matrix::Zero(n_, p_)};
    if (!fresh.empty()) {
        const Sized some = divided(chosen(PH, counted(0, n_), fresh), chosen(S, fresh, fresh));
        L.value(Eigen::all, fresh) = some.value;
        L.size(Eigen::all, fresh) = some.size;
    }
    for (int j : fresh) {
        mean(j) += levels_.weight * (eta_.value(j) / std::sqrt(S.value(j, j)) - mean(j));
    }
    drift = mean.cwiseAbs2().maxCoeff() * (2.0 - levels_.weight) / levels_.weight;
    ekf = exact(c.value) + L * eta_;
    for (int l = 0; l < n_; ++l) {
        Series &s = shift[static_cast<size_t>(l)]; /* c' + xi - L H */
        s.drop_constant();
        s.add(0, 0, ekf.value(l), ekf.size(l));
        for (int j = 0; j < p_; ++j) {
            s.add(H[static_cast<size_t>(j)], -L.value(l, j), L.size(l, j));
        }
    }
    for (int l = 0; l < n_; ++l) {
        F.push_back(put_in(plant_.f[static_cast<size_t>(l)], shift));
        c.size(l) = F.back().size[0](0);
        c.value(l) = F.back().drop_constant();
        F.back().add(1, n_ + l, 1.0, 1.0);
    }
    const Matrix slope = slope_at(ekf.value);
    const Sized G = linear_part(F, 0, n_), V = linear_part(F, 2 * n_, p_);
    const Matrix left = Pe.value - L.value * S.value * L.value.transpose();
    const Matrix moved = slope.cwiseAbs() * Pe.value.cwiseAbs() * slope.cwiseAbs().transpose();
    const Sized joseph = G * exact_Pe * transposed(G) + V * diagonal(R) * transposed(V) + diagonal(Q);
    Pe = {slope * left * slope.transpose() + Matrix(Q.asDiagonal()), joseph.size + moved};
}

/* Coefficients of all rows, of each monomial of the noise over [1; X]; above mu what is cut off. */
void PolynomialFilter::split(const std::vector<Series> &rows)
{
    const auto count = static_cast<Eigen::Index>(rows.size()), wide = static_cast<Eigen::Index>(X.size());
    by_noise_.assign(noises_.size(), Sized{Matrix::Zero(count, wide), Matrix::Zero(count, wide)});
    cut_ = {Matrix::Zero(count, static_cast<Eigen::Index>(ring_.size())), Matrix::Zero(count, static_cast<Eigen::Index>(ring_.size()))};
    for (Eigen::Index a = 0; a < count; ++a) {
        const Series &row = rows[static_cast<size_t>(a)];
        for (size_t k = 0; k < row.value.size(); ++k) {
            for (Eigen::Index at = 0; at < row.value[k].size(); ++at) {
                const int m = collected_[k][static_cast<size_t>(at)];
                cut_.value(a, m) += row.value[k](at);
                cut_.size(a, m) += row.size[k](at);
            }
        }
        for (size_t m = 0; m < ring_.size(); ++m) {
            if (ring_[m].size() <= static_cast<size_t>(mu_)) {
                const auto at = static_cast<Eigen::Index>(m);
                Sized &of = by_noise_[noise_at_[m]];
                of.value(a, state_at_[m]) = cut_.value(a, at);
                of.size(a, state_at_[m]) = cut_.size(a, at);
            }
        }
    }
}

/* N = sum of Cov(nu^b, nu^b') q_b M q_b' */
Sized PolynomialFilter::noise_covariance() const
{
    const Eigen::Index count = by_noise_.front().value.rows();
    Sized sum{Matrix::Zero(count, count), Matrix::Zero(count, count)};
    std::vector<Sized> weighed;
    for (const Sized &q : by_noise_) {
        weighed.push_back(exact(M.value) * transposed(q));
    }
    for (const Correlated &pair : correlated_) {
        const Sized product = by_noise_[pair.a] * weighed[pair.b];
        sum.value += pair.covariance * product.value;
        sum.size += std::abs(pair.covariance) * product.size;
    }
    return sum;
}

/* s^2 m, of m rows that cut something off (2.2, step 3): a monomial of mu + 1 states is its last times the others, else what it has of noise counts by the root of its
 * mean square. */
Sized PolynomialFilter::remainders() const
{
    const Eigen::Index count = cut_.value.rows();
    Sized s{Matrix::Zero(count, 1), Matrix::Zero(count, 1)};
    for (size_t m = 0; m < ring_.size(); ++m) {
        if (ring_[m].size() > static_cast<size_t>(mu_)) {
            Tuple  states = parts_[m].first;
            double worth = root_[m];
            if (states.size() > static_cast<size_t>(mu_)) {
                const int l = states.back();
                states.pop_back();
                worth = std::min(levels_.reach * std::sqrt(std::max(P.value(l, l), 0.0)), levels_.box(l));
            }
            const int at = state_place_.at(states);
            worth *= std::sqrt(std::max(M.value(at, at), 0.0));
            s.value += worth * cut_.value.col(static_cast<Eigen::Index>(m)).cwiseAbs();
            s.size += worth * cut_.size.col(static_cast<Eigen::Index>(m));
        }
    }
    const auto cutting = static_cast<double>((s.value.array() > 0.0).count());
    return {cutting * s.value.cwiseAbs2(), 2.0 * cutting * s.value.cwiseProduct(s.size)};
}

Sized PolynomialFilter::join(const Sized &linear, const Sized &N, double &bound, double &bound_size) const
{
    const Sized carried = linear * exact(P.value) * transposed(linear);
    bound = 1.0;
    bound_size = 0.0;
    if (!bounded_) {
        return carried + N;
    }
    const Sized slack = remainders(), whole = carried + N;
    const Eigen::Index rows = slack.value.size();
    double mean_share = 0.0, off = 0.0;
    for (Eigen::Index a = 0; a < rows; ++a) {
        const double w = whole.value(a, a);
        mean_share += (w > 0.0) ? slack.value(a) / (w * static_cast<double>(rows)) : 0.0;
        off = std::max(off, part(slack.size(a), slack.value(a)) + part(whole.size(a, a), w));
    }
    const double e = split_weight(mean_share);
    bound = 1.0 + e;
    bound_size = 0.5 * e * off;
    Sized J{bound * carried.value + N.value, bound * carried.size + N.size + bound_size * carried.value.cwiseAbs()};
    J.value.diagonal() += (1.0 + 1.0 / e) * slack.value;
    J.size.diagonal() += (1.0 + 1.0 / e) * slack.size + (bound_size / (e * e)) * slack.value;
    return J;
}

/* Which outputs are worth something: nothing is known of them, or less than is predicted. */
std::vector<bool> PolynomialFilter::worth(const Vector &radius, const Sized &J)
{
    std::vector<bool> found;
    for (int j = 0; j < p_; ++j) {
        const auto at = static_cast<Eigen::Index>(X.size()) - 1 + j;
        const double variance = J.value(at, at), r = radius(j);
        const bool fresh = r <= levels_.fresh(j);
        found.push_back(fresh || (std::isfinite(r) && r * r < variance));
        tie = tie || (!fresh && std::isfinite(r) && std::abs(r * r - variance) < 1e-3 * variance);
    }
    return found;
}

/* Y, how far it can be from that of the true measurement, and what is used of it. */
PolynomialFilter::Heard PolynomialFilter::hear(const Vector &radius, const Sized &J)
{
    const int N = static_cast<int>(X.size()) - 1, measured = static_cast<int>(Y.size());
    const std::vector<bool> good = worth(radius, J);
    Heard  h{{Matrix::Ones(measured, 1), Matrix::Zero(measured, 1)}, {Matrix::Zero(measured, 1), Matrix::Zero(measured, 1)}, {}, {}, 0, 0.0, 0.0};
    double share = 0.0, off = 0.0;
    for (int k = 0; k < measured; ++k) {
        double most = 1.0, most_size = 0.0;
        bool   use = true;
        for (int j : Y[static_cast<size_t>(k)]) {
            const double e = eta_.value(j), size = eta_.size(j), r = (radius(j) <= levels_.fresh(j) || !std::isfinite(radius(j))) ? 0.0 : radius(j);
            h.Y.size(k) = std::abs(h.Y.value(k)) * size + h.Y.size(k) * std::abs(e);
            h.Y.value(k) *= e;
            most_size = most * (size + r) + most_size * (std::abs(e) + r);
            most *= std::abs(e) + r;
            use = use && good[static_cast<size_t>(j)];
        }
        h.Delta.value(k) = most - std::abs(h.Y.value(k));
        h.Delta.size(k) = (h.Delta.value(k) > 0.0) ? most_size + h.Y.size(k) : 0.0;
        if (use) {
            const double D = h.Delta.value(k), variance = J.value(N + k, N + k);
            h.used.push_back(k);
            if (Y[static_cast<size_t>(k)].size() <= 2) {
                h.judged.push_back(static_cast<int>(h.used.size()) - 1);
            }
            h.silent += (D > 0.0) ? 1 : 0;
            share += D * D / variance;
            off = std::max(off, 2.0 * part(h.Delta.size(k), D) + part(J.size(N + k, N + k), variance));
        }
    }
    h.d = (h.silent > 0) ? split_weight(share * h.silent / static_cast<double>(h.used.size())) : 0.0;
    h.d_size = 0.5 * h.d * off;
    return h;
}

/* Covariance of what is used, with Delta in it. */
Sized PolynomialFilter::spread(const Heard &h, const Sized &J, const std::vector<int> &rows) const
{
    Sized S = widened(chosen(J, rows, rows), 1.0 + h.d, h.d_size);
    for (size_t i = 0; i < h.used.size() && h.silent > 0; ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        const double D = h.Delta.value(h.used[i]), D_size = h.Delta.size(h.used[i]);
        S.value(at, at) += (1.0 + 1.0 / h.d) * h.silent * D * D;
        S.size(at, at) += (1.0 + 1.0 / h.d) * h.silent * 2.0 * D * D_size + (h.d_size / (h.d * h.d)) * h.silent * D * D;
    }
    return S;
}

void PolynomialFilter::judge(const Vector &radius, const Sized &r, const Sized &J)
{
    double trace = 0.0, square = 0.0, wide = 0.0;
    for (int j = 0; j < p_; ++j) {
        const auto at = static_cast<Eigen::Index>(X.size()) - 1 + j;
        if (std::isfinite(radius(j))) {
            trace += J.value(at, at);
            square += r.value(j) * r.value(j);
            wide += (radius(j) > levels_.fresh(j)) ? radius(j) * radius(j) : 0.0;
        }
    }
    plain = std::sqrt(square);
    threshold = levels_.kappa * std::sqrt(trace) + std::sqrt(wide);
    joint = exact(Matrix::Zero(1, 1));
}

/* What the measurements move estimate and prediction by, and take from their covariances. */
PolynomialFilter::Gained PolynomialFilter::gain(const Heard &h, const Sized &linear, const Sized &J, const Sized &r, double bound, double bound_size)
{
    const int N = static_cast<int>(X.size()) - 1;
    const std::vector<int> none{0}, states = counted(0, n_), lifted = counted(0, N);
    std::vector<int> rows;
    for (int k : h.used) {
        rows.push_back(N + k);
    }
    const double wider = 1.0 + h.d;
    const Sized  S = spread(h, J, rows), Jxy = widened(chosen(J, lifted, rows), wider, h.d_size);
    const Sized  carried = exact(P.value) * transposed(chosen(linear, rows, lifted));
    const Sized  Pxy = widened(chosen(carried, states, counted(0, static_cast<int>(rows.size()))), wider * bound, h.d_size * bound + wider * bound_size);
    const Sized  used = chosen(r, h.used, none), judged = chosen(transposed(used), none, h.judged);
    const Sized  K = divided(Jxy, S), Kf = divided(Pxy, S);
    joint = divided(judged, chosen(S, h.judged, h.judged)) * transposed(judged);
    Gained made{K * used, Kf * used, K * transposed(Jxy), Kf * transposed(Pxy), wider};
    const Vector before = bound * P.value.diagonal().head(n_), after = wider * before - Vector(made.taken_f.value.diagonal());
    const double left = after.cwiseQuotient(before).sum();
    held = wider > 1.0 && left >= n_;
    tie = tie || (wider > 1.0 && std::abs(left - n_) < 1e-3 * n_);
    return made;
}

void PolynomialFilter::update(const Vector &radius, const Sized &whole, const Sized &J, double bound, double bound_size)
{
    const int N = static_cast<int>(X.size()) - 1, measured = static_cast<int>(Y.size());
    const Heard h = hear(radius, J);
    const Sized ahead = whole * exact(z.value), linear{whole.value.rightCols(N), whole.size.rightCols(N)};
    const Sized r{h.Y.value - ahead.value.bottomRows(measured), h.Y.size + ahead.size.bottomRows(measured)};
    judge(radius, r, J);
    held = false;
    Gained g{nothing(N, 1), nothing(n_, 1), nothing(N, N), nothing(n_, n_), 1.0};
    if (!h.used.empty()) {
        const Gained made = gain(h, linear, J, r, bound, bound_size);
        g = held ? g : made;
    }
    const double d_size = (g.wider > 1.0) ? h.d_size : 0.0;
    const std::vector<int> states = counted(0, n_), lifted = counted(0, N);
    const Sized Pn = widened(chosen(exact(P.value), states, states), g.wider * bound, d_size * bound + g.wider * bound_size);
    const Sized Jx = widened(chosen(J, lifted, lifted), g.wider, d_size);
    x = exact(c.value) + exact(z.value.middleRows(1, n_)) + g.move_f; /* c is still the point of expansion */
    Px = {Pn.value - g.taken_f.value, Pn.size + g.taken_f.size};
    z.value.bottomRows(N) = ahead.value.topRows(N) + g.move.value;
    z.size.bottomRows(N) = ahead.size.topRows(N) + g.move.size;
    P = {Jx.value - g.taken.value, Jx.size + g.taken.size};
}

std::vector<Series> PolynomialFilter::powers(const std::vector<Tuple> &of, const std::vector<Series> &variables)
{
    std::vector<Series> found;
    for (const Tuple &t : of) {
        found.push_back(variables[static_cast<size_t>(t[0])]);
        for (size_t i = 1; i < t.size(); ++i) {
            found.back() = found.back() * variables[static_cast<size_t>(t[i])];
        }
    }
    return found;
}

/* [1 m'; m A M A' + N] */
Sized PolynomialFilter::moments_after(const Sized &linear, const Sized &covariance) const
{
    const Eigen::Index wide = M.value.rows(), N = wide - 1;
    const Sized upper{linear.value.topRows(N), linear.size.topRows(N)};
    const Sized carried = upper * exact(M.value) * transposed(upper), first = upper * exact(M.value.col(0));
    Sized moved = exact(Matrix::Ones(wide, wide));
    moved.value.bottomRightCorner(N, N) = carried.value + covariance.value.topLeftCorner(N, N);
    moved.size.bottomRightCorner(N, N) = carried.size + covariance.size.topLeftCorner(N, N);
    moved.value.block(1, 0, N, 1) = first.value;
    moved.size.block(1, 0, N, 1) = first.size;
    moved.value.block(0, 1, 1, N) = first.value.transpose();
    moved.size.block(0, 1, 1, N) = first.size.transpose();
    return moved;
}

void PolynomialFilter::step(const Vector &y, const Vector &radius)
{
    tie = false;
    const Sized before = exact(c.value);
    std::vector<Series> H, F;
    auxiliary(y, radius, H, F);
    const Sized next = c;
    std::vector<Series> rows = powers(std::vector<Tuple>(X.begin() + 1, X.end()), F);
    for (const Series &s : powers(Y, H)) {
        rows.push_back(s);
    }
    split(rows);
    const auto count = static_cast<Eigen::Index>(rows.size());
    const Eigen::Index wide = M.value.rows(), N = wide - 1;
    Sized linear{Matrix::Zero(count, wide), Matrix::Zero(count, wide)};
    for (size_t b = 0; b < noises_.size(); ++b) {
        linear.value += noise_mean_[b] * by_noise_[b].value;
        linear.size += std::abs(noise_mean_[b]) * by_noise_[b].size;
    }
    const Sized states{linear.value.rightCols(N), linear.size.rightCols(N)}, covariance = noise_covariance();
    double bound = 1.0, bound_size = 0.0;
    const Sized J = join(states, covariance, bound, bound_size);
    const Sized moved = moments_after(linear, covariance);
    c = before;
    update(radius, linear, J, bound, bound_size);
    c = next;
    M = moved;
}

} // namespace oracle
