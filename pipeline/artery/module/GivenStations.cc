// SPDX-License-Identifier: GPL-2.0-only
#include "GivenStations.h"

#include "GivenMobility.h"
#include "Sender.h"

#include <artery/networking/GeoNetPacket.h>
#include <inet/physicallayer/contract/packetlevel/IRadioMedium.h>
#include <inet/physicallayer/contract/packetlevel/ITransmission.h>
#include <limits>

using namespace omnetpp;
using inet::physicallayer::IRadioMedium;

namespace advpipe
{

Define_Module(GivenStations)

namespace
{

constexpr unsigned cProtocol = 1; ///< of the records; given_records.py has the same number

} // namespace

GivenStations::GivenStations() :
    mRadios(mLink, [this](const cPacket& packet) { return mNumbers.at(packet.getTreeId()); })
{
}

GivenStations::~GivenStations()
{
    cancelAndDelete(mTick);
}

void GivenStations::initialize()
{
    const auto version = std::to_string(OMNETPP_VERSION >> 8) + "." + std::to_string(OMNETPP_VERSION & 0xff);
    mLink.open(par("host"), par("port"));
    mLink.write(Record('H').number(cProtocol, 2).text("OMNeT++ " + version));
    mLink.flush();
    mRadios.listen();
    getSystemModule()->subscribe(IRadioMedium::transmissionEndedSignal, static_cast<cListener*>(this));
    mTick = new cMessage("ask advpipe for the next step");
    mTick->setSchedulingPriority(std::numeric_limits<short>::min()); // before all else at this time
    scheduleAt(simTime(), mTick);
}

void GivenStations::handleMessage(cMessage*)
{
    mLink.write(Record('T').number(ns(simTime()), 8));
    mLink.flush();
    while (!mTick->isScheduled()) {
        obey(mLink.read());
    }
}

void GivenStations::obey(const std::string& record)
{
    RecordReader reader(record);
    switch (reader.kind()) {
    case 'P':
        place(reader);
        break;
    case 'Q':
        remove(reader.number(4));
        break;
    case 'M':
        send(reader);
        break;
    case 'U':
        scheduleAt(SimTime(reader.number(8), SIMTIME_NS), mTick);
        break;
    default:
        throw cRuntimeError("advpipe sent a record '%c', which this module does not know", reader.kind());
    }
}

void GivenStations::place(RecordReader& reader)
{
    const std::uint32_t id = reader.number(4);
    const double x = reader.real(), y = reader.real(), z = reader.real();
    const bool isNew = mStations.count(id) == 0;
    if (isNew) {
        auto module = cModuleType::get("advpipe.Station")->create("node", getSystemModule(), mPlaced + 1, mPlaced);
        ++mPlaced;
        module->finalizeParameters();
        module->buildInside();
        mStations[id] = module;
        mRadios.add(*module, id);
    }
    check_and_cast<GivenMobility*>(submodule(id, "mobility"))->place({ x, y, z });
    if (isNew) {
        mStations[id]->scheduleStart(simTime());
        mStations[id]->callInitialize();
    }
}

void GivenStations::remove(std::uint32_t id)
{
    auto module = mStations.at(id);
    mStations.erase(id);
    mRadios.remove(*module);
    module->callFinish();
    module->deleteModule();
}

void GivenStations::send(RecordReader& reader)
{
    const SimTime time(reader.number(8), SIMTIME_NS);
    const std::uint32_t id = reader.number(4);
    const std::uint64_t number = reader.number(8);
    const double powerDbm = reader.real();
    const auto bytes = reader.rest();
    auto packet = new artery::GeoNetPacket("GeoNet packet");
    packet->setPayload(std::unique_ptr<vanetza::CohesivePacket>(
        new vanetza::CohesivePacket(vanetza::ByteBuffer(bytes.begin(), bytes.end()), vanetza::OsiLayer::Network)));
    mNumbers[packet->getTreeId()] = number;
    check_and_cast<Sender*>(submodule(id, "sender"))->schedule(packet, powerDbm, time);
}

cModule* GivenStations::submodule(std::uint32_t station, const char* name) const
{
    auto found = mStations.find(station);
    if (found == mStations.end()) {
        throw cRuntimeError("advpipe named station %u, which is nowhere", station);
    }
    return found->second->getSubmodule(name);
}

/// Of all signals, the system module's listeners hear this one alone here: a frame is no longer on the air.
void GivenStations::receiveSignal(cComponent*, simsignal_t, cObject* object, cObject*)
{
    auto transmission = check_and_cast<inet::physicallayer::ITransmission*>(object);
    if (auto packet = packetIn(const_cast<cPacket*>(transmission->getMacFrame()))) {
        mLink.write(Record('E').number(ns(simTime()), 8).number(mNumbers.at(packet->getTreeId()), 8));
    }
}

} // namespace advpipe
