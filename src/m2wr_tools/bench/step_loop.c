/* The stepping loop in C against libode: what the compiled loop of the package is measured with.
 *
 * Reads a world from standard input, takes steps in runs and writes for each run the processor time of a step [ns];
 * at the end the position of the first body, so that it can be seen that both loops did the same work.
 *
 * Input, one item a line, numbers as printf's %a or %g writes them:
 *   world DT ERP CFM LAYER CORRECTING_VELOCITY GRAVITY_Z QUICK_ITERATIONS(0: direct solver) CLASSES RUNS STEPS
 *   pair CLASS CLASS MU LIMIT MERGE GROUND
 *   plane CLASS A B C D                       static
 *   box CLASS X Y Z W I J K LX LY LZ          of the last body, then posed relative to it; static before the first
 *   cylinder CLASS X Y Z W I J K RADIUS LENGTH
 *   sphere CLASS X Y Z W I J K RADIUS
 *   robot                                     a new space for what follows
 *   body X Y Z W I J K MASS IXX IYY IZZ IXY IXZ IYZ
 *   hinge CHILD PARENT X Y Z AX AY AZ RATE FORCE   bodies by number, counted within the robot
 */
#include <math.h>
#include <ode/ode.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define MAX_FOUND 150
#define MAX_CLASSES 64
#define MAX_ROBOTS 4096
#define MAX_BODIES 16
#define MAX_CONTACT_PAIRS 64
#define STEEP 0.5

typedef struct { int valid, limit, merge, ground; double mu; } Pair;

static Pair pairs[MAX_CLASSES][MAX_CLASSES];
static dContact found[MAX_FOUND];
static dGeomID contact_pairs[MAX_CONTACT_PAIRS][2];
static int contact_pair_count;
static long contacts;
static dWorldID world;
static dJointGroupID group;
static dSpaceID statics, moving, spaces[MAX_ROBOTS];
static int robots;

static void fail(const char *what)
{
    fprintf(stderr, "step_loop: cannot read: %s\n", what);
    exit(2);
}

static void merge(int count)
{
    double p[3] = {0, 0, 0}, n[3] = {0, 0, 0}, depth = 0.0, norm;
    int deepest = 0, i, k;
    for (i = 0; i < count; ++i) {
        for (k = 0; k < 3; ++k) {
            p[k] += found[i].geom.pos[k];
            n[k] += found[i].geom.normal[k];
        }
        if (found[i].geom.depth > depth) {
            depth = found[i].geom.depth;
            deepest = i;
        }
    }
    norm = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (norm < 0.5 * count) {
        found[0].geom = found[deepest].geom;
        return;
    }
    for (k = 0; k < 3; ++k) {
        found[0].geom.pos[k] = p[k] / count;
        found[0].geom.normal[k] = n[k] / norm;
    }
    found[0].geom.depth = depth;
}

static void spread(int count, int limit)
{
    int chosen[MAX_FOUND] = {0}, last = 0, best, i, k, kept = 0;
    double nearest[MAX_FOUND], farthest, square, d;
    for (i = 0; i < count; ++i) {
        nearest[i] = HUGE_VAL;
        if (found[i].geom.depth > found[last].geom.depth)
            last = i;
    }
    chosen[last] = 1;
    while (--limit > 0) {
        best = -1;
        farthest = -1.0;
        for (i = 0; i < count; ++i) {
            square = 0.0;
            for (k = 0; k < 3; ++k) {
                d = found[i].geom.pos[k] - found[last].geom.pos[k];
                square += d * d;
            }
            if (square < nearest[i])
                nearest[i] = square;
            if (nearest[i] > farthest && !chosen[i]) {
                best = i;
                farthest = nearest[i];
            }
        }
        chosen[best] = 1;
        last = best;
    }
    for (i = 0; i < count; ++i)
        if (chosen[i])
            found[kept++].geom = found[i].geom;
}

static void note_contact(dGeomID one, dGeomID two)
{
    int i;
    for (i = 0; i < contact_pair_count; ++i)
        if (contact_pairs[i][0] == one && contact_pairs[i][1] == two)
            return;
    if (contact_pair_count < MAX_CONTACT_PAIRS) {
        contact_pairs[contact_pair_count][0] = one;
        contact_pairs[contact_pair_count++][1] = two;
        ++contacts;
    }
}

static void near(void *data, dGeomID one, dGeomID two)
{
    const Pair *pair;
    dBodyID first, second;
    int count, i;
    if (dGeomIsSpace(one) || dGeomIsSpace(two)) {
        dSpaceCollide2(one, two, data, near);
        return;
    }
    pair = &pairs[(size_t)dGeomGetData(one)][(size_t)dGeomGetData(two)];
    if (!pair->valid)
        return;
    count = dCollide(one, two, MAX_FOUND, &found[0].geom, sizeof(dContact));
    if (!count)
        return;
    if (count > 1 && pair->merge) {
        merge(count);
        count = 1;
    } else if (count > pair->limit) {
        spread(count, pair->limit);
        count = pair->limit;
    }
    first = dGeomGetBody(one);
    second = dGeomGetBody(two);
    for (i = 0; i < count; ++i) {
        double nz = found[i].geom.normal[2];
        int steep = nz > -STEEP && nz < STEEP;
        found[i].surface.mode = dContactApprox1;
        found[i].surface.mu = pair->mu;
        if (!pair->ground && (steep || (first && second)))
            note_contact(one, two);
        dJointAttach(dJointCreateContact(world, group, &found[i]), first, second);
    }
}

static void run(long steps, double dt, int quick)
{
    while (steps-- > 0) {
        int i;
        for (i = 0; i < robots; ++i)
            dSpaceCollide2((dGeomID)spaces[i], (dGeomID)statics, 0, near);
        if (robots > 1)
            dSpaceCollide(moving, 0, near);
        if (quick)
            dWorldQuickStep(world, dt);
        else
            dWorldStep(world, dt);
        dJointGroupEmpty(group);
        contact_pair_count = 0;
    }
}

/* Read ``count`` numbers; where they do not come, say in which item. */
static void numbers(double *to, int count, const char *item)
{
    while (count-- > 0)
        if (scanf("%lf", to++) != 1)
            fail(item);
}

static void finish_geom(dGeomID geom, const double *v, dBodyID body)
{
    dQuaternion turn = {v[4], v[5], v[6], v[7]};
    dGeomSetData(geom, (void *)(size_t)v[0]);
    if (body) {
        dGeomSetBody(geom, body);
        dGeomSetOffsetPosition(geom, v[1], v[2], v[3]);
        dGeomSetOffsetQuaternion(geom, turn);
    } else if (dGeomGetClass(geom) != dPlaneClass) {
        dGeomSetPosition(geom, v[1], v[2], v[3]);
        dGeomSetQuaternion(geom, turn);
    }
    dGeomSetCategoryBits(geom, body ? 2 : 1);
    dGeomSetCollideBits(geom, body ? 0x7fffffff : 0);
}

static void read_pair(void)
{
    double v[6];
    Pair *pair;
    numbers(v, 6, "pair");
    if (v[0] >= MAX_CLASSES || v[1] >= MAX_CLASSES)
        fail("pair: too many classes");
    pair = &pairs[(int)v[0]][(int)v[1]];
    pair->valid = 1;
    pair->mu = v[2];
    pair->limit = (int)v[3];
    pair->merge = (int)v[4];
    pair->ground = (int)v[5];
}

static dBodyID read_body(void)
{
    double v[14];
    dQuaternion turn;
    dMass mass;
    dBodyID body = dBodyCreate(world);
    numbers(v, 14, "body");
    dMassSetParameters(&mass, v[7], 0, 0, 0, v[8], v[9], v[10], v[11], v[12], v[13]);
    dBodySetMass(body, &mass);
    dBodySetPosition(body, v[0], v[1], v[2]);
    turn[0] = v[3];
    turn[1] = v[4];
    turn[2] = v[5];
    turn[3] = v[6];
    dBodySetQuaternion(body, turn);
    return body;
}

static void read_hinge(const dBodyID *bodies)
{
    double v[10];
    dJointID joint = dJointCreateHinge(world, 0);
    numbers(v, 10, "hinge");
    dJointAttach(joint, bodies[(int)v[0]], bodies[(int)v[1]]);
    dJointSetHingeAnchor(joint, v[2], v[3], v[4]);
    dJointSetHingeAxis(joint, v[5], v[6], v[7]);
    dJointSetHingeParam(joint, dParamVel, v[8]);
    dJointSetHingeParam(joint, dParamFMax, v[9]);
}

static void create_world(const double *v)
{
    dVector3 middle = {0, 0, 0}, extent = {100, 100, 100};
    world = dWorldCreate();
    dWorldSetERP(world, v[1]);
    dWorldSetCFM(world, v[2]);
    dWorldSetContactSurfaceLayer(world, v[3]);
    dWorldSetContactMaxCorrectingVel(world, v[4]);
    dWorldSetGravity(world, 0, 0, v[5]);
    if (v[6] > 0)
        dWorldSetQuickStepNumIterations(world, (int)v[6]);
    statics = dQuadTreeSpaceCreate(0, middle, extent, 6);
    moving = dHashSpaceCreate(0);
    group = dJointGroupCreate(0);
}

int main(void)
{
    char item[16];
    double head[10] = {0}, v[11];
    dBodyID bodies[MAX_BODIES], first = 0;
    dSpaceID space = 0;
    int count = 0;
    long k;
    dInitODE2(0);
    if (scanf("%15s", item) != 1 || strcmp(item, "world"))
        fail("expected \"world\" first");
    numbers(head, 10, item);
    create_world(head);
    space = statics;
    while (scanf("%15s", item) == 1) {
        dBodyID body = count ? bodies[count - 1] : 0;
        if (!strcmp(item, "pair")) {
            read_pair();
        } else if (!strcmp(item, "plane")) {
            numbers(v, 5, item);
            finish_geom(dCreatePlane(statics, v[1], v[2], v[3], v[4]), v, 0);
        } else if (!strcmp(item, "box")) {
            numbers(v, 11, item);
            finish_geom(dCreateBox(space, v[8], v[9], v[10]), v, body);
        } else if (!strcmp(item, "cylinder")) {
            numbers(v, 10, item);
            finish_geom(dCreateCylinder(space, v[8], v[9]), v, body);
        } else if (!strcmp(item, "sphere")) {
            numbers(v, 9, item);
            finish_geom(dCreateSphere(space, v[8]), v, body);
        } else if (!strcmp(item, "robot")) {
            if (robots == MAX_ROBOTS)
                fail("robot: too many");
            space = spaces[robots++] = dSimpleSpaceCreate(moving);
            count = 0;
        } else if (!strcmp(item, "body")) {
            if (count == MAX_BODIES)
                fail("body: too many in one robot");
            bodies[count++] = read_body();
            first = first ? first : bodies[0];
        } else if (!strcmp(item, "hinge")) {
            read_hinge(bodies);
        } else {
            fail(item);
        }
    }
    for (k = 0; k < (long)head[8]; ++k) {
        clock_t start = clock();
        run((long)head[9], head[0], head[6] > 0);
        printf("%.3f\n", 1e9 * (double)(clock() - start) / CLOCKS_PER_SEC / head[9]);
    }
    if (first) {
        const dReal *at = dBodyGetPosition(first);
        printf("at %a %a %a contacts %ld\n", at[0], at[1], at[2], contacts);
    }
    return 0;
}
