"""Bags as rosbag2 lays them out, written by another author's library."""
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode
from rosbags.typesys import get_typestore, Stores


def write_bag(path, types, messages, plugin=StoragePlugin.MCAP, compression=CompressionMode.STORAGE):
    """Write messages (topic, received, bytes) of `types`, topic -> name, into a new folder, as rosbag2 does."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with_writer = Writer(path, version=9, storage_plugin=plugin)
    if compression != CompressionMode.NONE:
        with_writer.set_compression(compression, CompressionFormat.ZSTD)
    with with_writer as writer:
        connections = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in types.items()}
        for topic, received, data in sorted(messages, key=lambda message: message[1]):
            writer.write(connections[topic], received, data)
    return path
