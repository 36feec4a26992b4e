using System;
using UnityEngine;
using UnityEngine.Playables;
using UnityEngine.Timeline;

namespace Gsac.Samples
{
    /// <summary>A Timeline track for a person's face; an animation track on the Animator beside it moves the body.</summary>
    [TrackClipType(typeof(GsacFaceClip))]
    [TrackBindingType(typeof(GsacAvatar))]
    public sealed class GsacFaceTrack : TrackAsset
    {
        public override Playable CreateTrackMixer(PlayableGraph graph, GameObject go, int inputCount)
        {
            return ScriptPlayable<GsacFaceMixer>.Create(graph, inputCount);
        }
    }

    /// <summary>Sets the expressions of all pieces that play; expressions that no piece names stay as they are.</summary>
    public sealed class GsacFaceMixer : PlayableBehaviour
    {
        public override void ProcessFrame(Playable playable, FrameData info, object playerData)
        {
            var avatar = playerData as GsacAvatar;
            if (avatar == null || !avatar.CanOpen) return;
            for (int pass = 0; pass < 2; pass++)
            {
                for (int i = 0; i < playable.GetInputCount(); i++)
                {
                    GsacFacePiece piece = ((ScriptPlayable<GsacFacePiece>)playable.GetInput(i)).GetBehaviour();
                    int e = Array.IndexOf(avatar.Data.Expressions, piece.Expression);
                    if (e < 0) continue;
                    // pieces of one expression add up
                    avatar.SetExpression(piece.Expression, pass == 0 ? 0 : Math.Min(1, avatar.Weights[e] + piece.Weight * playable.GetInputWeight(i)));
                }
            }
        }
    }
}
