// Stands for what a sample takes from the package com.unity.timeline (1.2 and newer).
using System;
using UnityEngine;
using UnityEngine.Playables;

namespace UnityEngine.Timeline
{
    [Flags] public enum ClipCaps { Blending = 16 }
    public interface ITimelineClipAsset { ClipCaps clipCaps { get; } }

    public abstract class TrackAsset : PlayableAsset
    {
        public virtual Playable CreateTrackMixer(PlayableGraph graph, GameObject go, int inputCount) { return new Playable(); }
        public override Playable CreatePlayable(PlayableGraph graph, GameObject owner) { return new Playable(); }
    }

    [AttributeUsage(AttributeTargets.Class)] public sealed class TrackClipTypeAttribute : Attribute { public TrackClipTypeAttribute(Type clipClass) { } }
    [AttributeUsage(AttributeTargets.Class)] public sealed class TrackBindingTypeAttribute : Attribute { public TrackBindingTypeAttribute(Type type) { } }
}
